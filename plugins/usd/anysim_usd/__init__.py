"""USD files as robots, objects and worlds of anysim, and worlds of anysim as USD files."""
