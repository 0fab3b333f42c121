"""Collect successful trajectories with the scripted expert, read one, and replay it to the bit."""

import tempfile
from pathlib import Path

import anysim
from anysim.record.reader import open_trajectory
from anysim.record.replay import replay
from anysim.skills.runner import SkillPolicy
from anysim_recording.collector import Collector

with tempfile.TemporaryDirectory() as folder:
    with anysim.make("pick_cube", num_envs=2, overrides=["record.cameras=[front]", "record.fps=10"]) as env:
        for result in Collector(env, SkillPolicy(env), Path(folder), episodes=2, seed=7).run():
            print(f"env {result.env}: {result.status} in {result.steps} steps")
            path = result.path or Path()
    trajectory = open_trajectory(path)
    print("recorded:", sorted(trajectory.states), "actions", trajectory.actions.shape)
    frames = sum(1 for _ in trajectory.images("front"))
    print("frames of the front camera:", frames)
    print("replay:", replay(path).drift)
