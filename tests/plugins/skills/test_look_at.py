"""Cameras that robots carry are turned towards things, by a pan-tilt unit or by an arm."""

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

WORLDS = Path(__file__).parent / "worlds"
CAMERAS = {"look_at": ("eye", "ball"), "look_from_wrist": ("wrist", "cube")}


def off_axis(world: str, engine: str, num_envs: int, *overrides: str) -> tuple[list[Outcome], Array]:
    """The outcomes, and the angle [rad] between the optical axis and the target in the end."""
    require_engine(engine)
    camera, target = CAMERAS[world]
    with make(WORLDS / f"{world}.yaml", engine=engine, num_envs=num_envs, overrides=overrides) as env:
        env.reset(seed=11)
        policy, everyone = SkillPolicy(env), np.arange(num_envs)
        policy.begin(everyone)
        while env.running.all() and not policy.skill.outcome.all():
            env.step(policy.act(everyone))
        eye = env.engine.camera_poses(camera)
        way = env.scene.frame(target).position - eye[:, :3]
        along = P.rotate(eye[:, 3:], np.tile([0.0, 0.0, 1.0], (num_envs, 1)))
        return [OUTCOMES[o] for o in policy.skill.outcome], np.arccos(P.dot(along, way) / P.norm(way))


@pytest.mark.parametrize("world", CAMERAS)
def test_it_looks_at_the_target(world: str) -> None:
    outcomes, angles = off_axis(world, "mujoco", 4)
    assert outcomes == [Outcome.OK] * 4
    assert (angles < 0.03).all()


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
@pytest.mark.parametrize("world", CAMERAS)
def test_it_looks_at_the_target_on_the_other_engines(world: str, engine: str) -> None:
    outcomes, angles = off_axis(world, engine, 4)
    assert outcomes == [Outcome.OK] * 4
    assert (angles < 0.03).all()


def test_a_target_that_the_joints_cannot_turn_to_is_no_ik() -> None:
    """Pitch alone, though it goes over the top, does not turn aside to what is behind."""
    behind = ("task.expert.joints=[pitch]", "world.layout.ball={on: terrain, x: -1.0, y: 1.5}")
    outcomes, angles = off_axis("look_at", "mujoco", 1, *behind)
    assert outcomes == [Outcome.NO_IK]
    assert angles[0] > 0.5


def test_joints_that_do_not_carry_the_camera_are_refused() -> None:
    with pytest.raises(TaskError, match=r"'eye' is not carried by roll2 of 'eye\.arm'; joints .*: yaw, pitch, roll"):
        off_axis("look_at", "mujoco", 1, "task.expert.joints=[roll2]")
