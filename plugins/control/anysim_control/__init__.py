"""Controllers that compute with a robot's mechanics: differential IK, quadratic programs, operational space."""
