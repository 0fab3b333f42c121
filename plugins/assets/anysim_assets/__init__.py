"""Procedural assets: cabinets, lids, valves, wheeled bases, a gripper, a flying camera; rooms and generated ground."""
