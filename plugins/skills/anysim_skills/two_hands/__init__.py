"""Skills of two arms: lift, place, scoop and squeeze together, hand over."""
