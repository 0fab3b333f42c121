"""Motion planning on Pinocchio and Coal, and threads that plan beside the simulation."""
