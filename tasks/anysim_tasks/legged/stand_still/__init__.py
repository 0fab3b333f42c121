"""Stand on four legs for five seconds, by joint positions, against pushes."""
