"""A stranger's sensor: its wheel beside ours in a fresh environment, and its readings in a recording that replays."""

import json

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("wheels")]  # built once, by one worker

RUN = """
import sys
from pathlib import Path
import numpy as np
import anysim
from anysim_barometer import barometer
from anysim_recording.collector import Collector
from anysim.record.reader import open_trajectory
from anysim.testing.sensors import check_sensor


class Still:
    name = "still"
    def __init__(self, env): self.env = env
    def begin(self, env_ids): pass
    def act(self, env_ids): return np.zeros((self.env.num_envs, 0))
    def gave_up(self, env_ids): return np.zeros(len(env_ids), bool)
    def solved(self, env_ids): return np.zeros(len(env_ids), bool)
    def ended(self, env, success): return {}
    def describe(self, env): return {}


world = Path(barometer.__file__).with_name("falling.yaml")
check_sensor(world, "gauge")
with anysim.make(world, num_envs=2, overrides=["record.keep=all"]) as env:
    results = list(Collector(env, Still(env), Path("runs"), 2, seed=1).run())
print(open_trajectory(results[0].path).states["sensor_gauge_pressure"].shape)
"""


def test_its_wheel_brings_a_sensor_that_is_read_recorded_and_replayed(
    environment, program, external_wheels, tmp_path
) -> None:
    wheel = external_wheels["anysim-barometer"]
    members = ("anysim", "anysim-mujoco", "anysim-sensors", "anysim-mcap", "anysim-inspect", "anysim-recording")
    python = environment(*members, others=(wheel,))
    anysim = python.with_name("anysim")
    rows = {row["name"]: row for row in json.loads(program(anysim, "list", "sensors", "--json", cwd=tmp_path).stdout)}
    assert rows["barometer"]["from"] == "anysim-barometer"
    assert program(python, "-c", RUN, cwd=tmp_path).stdout == "(60,)\n"
    assert "2 of 2 replays are identical to the bit" in program(anysim, "replay", "runs", cwd=tmp_path).stdout
