"""Controllers of tools: inverse kinematics, operational space and their parts."""
