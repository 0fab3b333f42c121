"""Skills with sand and ropes: scooping grains, and laying a rope around posts; and terms that measure a rope."""
