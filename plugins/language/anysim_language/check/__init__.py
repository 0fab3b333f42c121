"""The independent reading of episodes: raw floats, triangles and code of its own, which answers are verified with."""
