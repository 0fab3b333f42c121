"""MuJoCo as an engine of anysim."""
