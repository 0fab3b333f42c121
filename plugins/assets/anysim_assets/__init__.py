"""Procedural builders: cabinets, lids, valves, wheeled bases, a gripper, a flying camera; furnished rooms."""
