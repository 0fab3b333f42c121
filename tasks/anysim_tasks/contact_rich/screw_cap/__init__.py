"""A Panda screws the cap of a jar tight, with several grasps."""
