"""Engine-neutral motion: kinematic chains, inverse kinematics and straight tool paths."""
