"""Records: one directory per trajectory, written aside and committed by one rename.

`recorder.Recorder` writes, `reader.open_trajectory` reads, `verify.verify` looks for damage, `replay.compare_states`
says how far a replay came out. What a trajectory is made of is in `header`, `frame` and `manifest`; how it is encoded
belongs to the writers and readers, which are plugins.
"""
