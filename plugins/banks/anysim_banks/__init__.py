"""Candidate banks: grasps sampled on affordances, tried in physics, and the best of them kept."""
