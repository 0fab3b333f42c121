"""Skills that grasp one object with one gripper."""
