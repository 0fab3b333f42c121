"""Ground that stays where an env is built anew for another centre of mass: the bits are those of a whole build."""

from typing import Any

import numpy as np
import pytest

import anysim
from anysim.engine.state import SnapshotLevel
from anysim_pybullet import client

ROUGH = "{kind: rough, amplitude: 0.02, size: [3.0, 3.0], cell: 0.1, friction: 0.8}"
CASES = {
    "go1_velocity": [],
    "pick_cube": ["world.objects.cube.com_offset={range: [[-0.005, -0.005, -0.005], [0.005, 0.005, 0.005]]}"],
}
"""A robot whose centre of mass is drawn, and fingers that follow each other beside a cube that has it drawn."""


def run(task: str, monkeypatch: pytest.MonkeyPatch, kept: int) -> tuple[list[Any], int]:
    """States of three episodes, with ground that is kept so often; and how often it was kept."""
    monkeypatch.setattr(client, "WIDE", 100)
    monkeypatch.setattr(client, "KEPT", kept)
    count, renew = [0], client.Env._renew_trees

    def counting(env: client.Env) -> None:
        count[0] += 1
        renew(env)

    monkeypatch.setattr(client.Env, "_renew_trees", counting)
    overrides = ["record.cameras=[]", f"world.terrain={ROUGH}", *CASES[task]]
    states: list[Any] = []
    draws = np.random.default_rng(0)
    with anysim.make(task, engine="pybullet", num_envs=2, overrides=overrides) as env:
        for seed in range(3):
            env.reset(seed=seed)
            for _ in range(15):
                env.step(draws.uniform(-0.3, 0.3, (2, env.action_dim)), env.running)
            state = env.engine.get_state()
            states.append((state.body_pose, state.body_twist, state.joint_pos, state.joint_vel, state.contact_force))
        kept_file = env.engine.snapshot(level=SnapshotLevel.TRAJECTORY)
        env.engine.step(10)
        after = env.engine.get_state().body_pose
        env.engine.restore(kept_file)
        env.engine.step(10)
        assert np.array_equal(env.engine.get_state().body_pose, after)
    return states, count[0]


@pytest.mark.slow
@pytest.mark.parametrize("task", CASES)
def test_the_bits_are_those_of_a_whole_build(task: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        wanted, none = run(task, patch, 0)
    found, kept = run(task, monkeypatch, 2)
    assert none == 0
    assert kept == 4, "in each of two envs two of three times"
    for rows, others in zip(found, wanted, strict=True):
        assert all(map(np.array_equal, rows, others))
