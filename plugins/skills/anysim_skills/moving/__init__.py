"""Skills that move the arm, or things without holding them."""
