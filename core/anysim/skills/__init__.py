"""Skills: an action symbol upward, a state machine downward that acts only through the robot's action channels."""
