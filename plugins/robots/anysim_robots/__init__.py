"""The robot catalogue of anysim: one YAML file a robot."""
