"""LeRobot's environments: its parser imports this package and `config`, which declares `--env.type=anysim`."""
