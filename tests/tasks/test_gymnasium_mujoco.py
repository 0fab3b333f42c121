"""The examples of gymnasium's Ant and Humanoid: on MuJoCo their observations are gymnasium's own."""

from pathlib import Path

import gymnasium
import numpy as np
import pytest

import anysim
from anysim.math import pose as P
from anysim.task.env import TaskEnv

EXAMPLES = Path(__file__).parents[2] / "docs/examples/gymnasium"
LEFT_OUT = {
    "ant": ("Ant-v5", {"include_cfrc_ext_in_observation": False}),
    "humanoid": (
        "Humanoid-v5",
        dict.fromkeys(
            ("include_cinert_in_observation", "include_cvel_in_observation", "include_cfrc_ext_in_observation"), False
        ),
    ),
}
"""What of gymnasium's observation is not observed here: it is of the step before, see docs/use_from_gymnasium.md."""


def begun(env: TaskEnv, own: gymnasium.Env) -> None:
    """Put both into the state that gymnasium drew, its quaternion made unit."""
    theirs = own.unwrapped
    own.reset(seed=3)
    q, v = theirs.data.qpos.copy(), theirs.data.qvel.copy()
    q[3:7] /= np.linalg.norm(q[3:7])
    theirs.set_state(q, v)
    turn = np.array([*q[4:7], q[3]])
    env.engine.set_body_state(pose=[*q[:3], *turn], twist=[*v[:3], *P.rotate(turn, v[3:6])], bodies=[0])
    env.engine.set_joint_state(position=q[7:], velocity=v[6:])


@pytest.mark.parametrize("name", ["ant", "humanoid"])
def test_observations_are_gymnasiums_own(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """50 steps of the same random actions, in and out of contact; also once they have fallen."""
    monkeypatch.chdir(EXAMPLES)
    task, left_out = LEFT_OUT[name]
    own = gymnasium.make(task, **left_out, terminate_when_unhealthy=False)
    rng, touching, worst = np.random.default_rng(0), 0, 0.0
    fallen = ["task.failure.low.height=-9", "task.failure.high.of.under.height=9"]
    with anysim.make(f"{name}.yaml", overrides=fallen, engine="mujoco") as env:
        env.reset(seed=0)
        begun(env, own)
        low, high = env.action_bounds
        assert low.tolist() == own.action_space.low.astype(float).round(6).tolist()
        for _ in range(50):
            action = rng.uniform(low, high)
            theirs = own.step(action)[0]
            ours = env.step(action[None]).obs["policy"][0]
            assert ours.shape == theirs.shape
            worst = max(worst, float(np.abs(ours - theirs).max()))
            touching += own.unwrapped.data.ncon > 0
    own.close()
    assert worst < 1e-3
    assert touching > 10
