"""Teleoperation: input devices that drive the tool of a robot, and the recording of what they do."""
