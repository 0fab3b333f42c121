"""The engine contract: what a physics engine must do to run a World."""
