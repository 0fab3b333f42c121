"""A camera at the wrist is carried around a cube, and stops at views of it."""

from pathlib import Path

import numpy as np
import pytest

from anysim import make
from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_engine

WORLD = Path(__file__).parent / "worlds/orbit.yaml"
VIEWS, ARC, RADIUS = 5, 1.5, 0.3


def carried(engine: str, num_envs: int, *overrides: str) -> tuple[list[Outcome], Array, Array]:
    """Outcomes, and at the end of each view (V, N) the way (.., 3) from cube to camera and the angle off its axis."""
    require_engine(engine)
    with make(WORLD, engine=engine, num_envs=num_envs, overrides=overrides) as env:
        env.reset(seed=11)
        policy, everyone = SkillPolicy(env), np.arange(num_envs)
        policy.begin(everyone)
        ways, angles = np.zeros((VIEWS, num_envs, 3)), np.zeros((VIEWS, num_envs))
        while env.running.all() and not policy.skill.outcome.all():
            env.step(policy.act(everyone))
            eye = env.engine.camera_poses("wrist")
            env.scene.look(None)
            way = eye[:, :3] - env.scene.frame("cube").position
            along = P.rotate(eye[:, 3:], np.tile([0.0, 0.0, 1.0], (num_envs, 1)))
            for i in everyone[(policy.skill.phase > 0) & (policy.skill.phase <= VIEWS)]:
                ways[policy.skill.phase[i] - 1, i] = way[i]
                angles[policy.skill.phase[i] - 1, i] = np.arccos(min(1.0, -along[i] @ way[i] / np.linalg.norm(way[i])))
        return [OUTCOMES[o] for o in policy.skill.outcome], ways, angles


def sees_it_from_all_sides(engine: str) -> None:
    outcomes, ways, angles = carried(engine, 3)
    assert outcomes == [Outcome.OK] * 3
    assert (angles < 0.05).all()
    assert np.abs(P.norm(ways) - RADIUS).max() < 0.015
    azimuth = np.unwrap(np.arctan2(ways[..., 1], ways[..., 0]), axis=0)
    assert np.abs(np.abs(np.diff(azimuth, axis=0)) - ARC / (VIEWS - 1)).max() < 0.1
    assert np.abs(np.arcsin(ways[..., 2] / P.norm(ways)) - 0.9).max() < 0.05


def test_it_stops_at_views_around_the_target() -> None:
    sees_it_from_all_sides("mujoco")


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
def test_it_does_on_the_other_engines(engine: str) -> None:
    sees_it_from_all_sides(engine)


def test_views_that_the_arm_does_not_reach_are_no_ik() -> None:
    assert carried("mujoco", 1, "task.expert.radius=1.2")[0] == [Outcome.NO_IK]


def test_a_camera_that_the_tool_does_not_carry_is_refused() -> None:
    with pytest.raises(TaskError, match="the camera 'front' is carried by the world, and the tool 'tool' by"):
        carried("mujoco", 1, "task.expert.camera=front")
