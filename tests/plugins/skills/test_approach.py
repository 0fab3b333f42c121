"""A base drives to where its arm can grasp: around what is in the way, and honest where there is no such place."""

from pathlib import Path

import numpy as np
import pytest

from anysim import make
from anysim.skills.base import Outcome
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from anysim_skills.arm import Arm
from anysim_skills.moving.footprint import CLEAR, Footprint
from tests.plugins.skills.test_navigate import driven

WORLD = Path(__file__).parent / "worlds/approach.yaml"
NUM_ENVS = 4


def made(engine: str, *overrides: str) -> TaskEnv:
    env = make(WORLD, engine=engine, num_envs=NUM_ENVS, overrides=["task.on_success=continue", *overrides])
    env.reset(seed=11)
    return env


def fetches(engine: str) -> None:
    require_engine(engine)
    with made(engine) as env:
        assert driven(env, 500) == [Outcome.OK] * NUM_ENVS
        env.scene.look(None)
        assert (env.scene.frame("cube").position[:, 2] > 0.5).all()


def test_what_it_drives_to_is_then_grasped() -> None:
    fetches("mujoco")


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
def test_it_is_grasped_on_the_other_engines(engine: str) -> None:
    fetches(engine)


def test_what_no_place_on_the_ground_is_near_enough_to_is_unreachable() -> None:
    with made("mujoco", "world.objects.table.source={box: [3.0, 3.0, 0.4]}") as env:
        assert driven(env, 500) == [Outcome.UNREACHABLE_BASE] * NUM_ENVS


def test_a_footprint_ends_where_the_base_does() -> None:
    with made(
        "mujoco", "world.layout.table.position=[5.0, 0.5, 0.2]", "world.layout.cube={position: [4.9, 0.5, 0.42]}"
    ) as env:
        robot, everyone = env.scene.robot("robot"), np.arange(NUM_ENVS)
        footprint = Footprint(env, robot, robot.base, Arm.of(env, robot).chain.joints)
        wheels = [b for b, body in enumerate(env.engine.world.bodies) if "wheel" in body.name]
        side = max(0.25, np.abs(env.engine.get_state().body_pose[0, wheels, 1]).max() + 0.08)
        for yaw, reach in ((0.0, 0.3), (np.pi, 0.3), (np.pi / 2, side), (-np.pi / 2, side)):  # the base is .6 x .5 m
            touching = 1.5 - 0.15 - reach - CLEAR  # the middle of the crate, and half of its length
            stands = np.array([[touching - 0.002, 0.85, yaw], [touching + 0.002, 0.85, yaw], [1.5, 0.85, yaw + 0.4]])
            free = footprint.free(footprint.look(everyone, everyone), np.tile(stands, (NUM_ENVS, 1, 1)))
            assert free.tolist() == [[True, False, False]] * NUM_ENVS


def test_a_corner_that_passes_a_corner_is_free() -> None:
    with made(
        "mujoco", "world.layout.table.position=[5.0, 0.5, 0.2]", "world.layout.cube={position: [4.9, 0.5, 0.42]}"
    ) as env:
        robot, one = env.scene.robot("robot"), np.arange(1)
        footprint = Footprint(env, robot, robot.base, Arm.of(env, robot).chain.joints)
        # Half a diagonal of the base, turned by its own angle, points at the corner of the crate.
        tip, corner = np.hypot(0.3 + CLEAR, 0.25 + CLEAR), np.array([1.5 - 0.15, 0.85 - 0.2])
        yaw = np.pi / 4 - np.arctan2(0.25 + CLEAR, 0.3 + CLEAR)
        off = np.array([np.cos(np.pi / 4), np.sin(np.pi / 4)])
        stands = np.array([[*(corner - (tip + gap) * off), yaw] for gap in (0.01, -0.06)])
        assert footprint.free(footprint.look(one, one), stands[None]).tolist() == [[True, False]]
