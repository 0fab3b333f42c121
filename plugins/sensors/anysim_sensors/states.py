"""States of the cells of an occupancy grid, as maps of ROS have them but for `occupied`, which is 100 there."""

UNKNOWN, FREE, OCCUPIED = -1, 0, 1
