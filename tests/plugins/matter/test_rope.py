"""Ropes as terms and skills see them: how one goes around posts, and where points along it are."""

import numpy as np
import pytest

import anysim
from anysim.errors import TaskError
from anysim.skills.base import OUTCOMES, Outcome
from anysim.task.scene import Frame
from anysim_matter.cord import Cord
from anysim_matter.rope_grasp import RopeGrasp
from anysim_matter.terms import Around, PointAt
from tests.tasks.matter_paths import put_cable
from tests.tasks.states import blind


def around(env: anysim.TaskEnv, post: Frame, angles: np.ndarray, radius: float = 0.05) -> tuple[float, float]:
    """What is found of a cable whose points are at angles (V,) [rad] of a circle about a post."""
    circle = radius * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    put_cable(env, post.position[:, None] + circle)
    turn, near = Cord(env.scene, env.scene.category("cable")).around(post)
    return float(turn[0]), float(near[0])


def test_a_rope_goes_around_a_post_by_an_angle_with_a_sign_and_comes_near_to_it() -> None:
    with blind("route_cable", "mujoco", 1) as env:
        env.reset(seed=2)
        cable, post = env.scene.category("cable"), env.scene.frame("near_post")
        cord = Cord(env.scene, cable)
        assert [cord.nearest(along) for along in (0.0, 0.5, 1.0)] == [0, 15, 30]
        turn, near = around(env, post, np.linspace(0.2, 0.2 + 7.0, 31))
        assert turn == pytest.approx(7.0)  # more than once
        assert near == pytest.approx(0.05 * np.cos(7.0 / 60), abs=1e-9)  # between two points it is nearer
        assert around(env, post, np.linspace(3.0, 1.0, 31))[0] == pytest.approx(-2.0)
        right = Around(env.scene, category=cable, b=post, angle=-1.9)
        assert right().all()
        assert not Around(env.scene, category=cable, b=post, angle=1.9)().any()
        assert not Around(env.scene, category=cable, b=post, angle=-2.1)().any()
        assert not Around(env.scene, category=cable, b=post, angle=-1.9, within=0.04)().any()
        assert PointAt(env.scene, category=cable, b=post, at=0.5, within=0.051)().all()
        assert not PointAt(env.scene, category=cable, b=post, at=0.5, within=0.049)().any()


def test_other_matter_is_no_rope() -> None:
    with blind("scoop_sand", "mujoco", 1, "world.families.sand.box=[0.03, 0.03, 0.03]") as env:
        env.reset(seed=2)
        with pytest.raises(TaskError, match="'sand' is no rope"):
            Cord(env.scene, env.scene.category("sand"))
        with pytest.raises(TaskError, match="'bowl' is no family of matter"):
            Cord(env.scene, env.scene.category("bowl"))


def test_a_rope_that_the_arm_does_not_reach_is_no_ik_at_once() -> None:
    with blind("route_cable", "mujoco", 1) as env:
        env.reset(seed=2)
        cable, everyone = env.scene.category("cable"), np.array([0])
        put_cable(env, np.linspace([[2.0, 0.0, 0.02]], [[2.5, 0.0, 0.02]], 31, axis=1))
        env.scene.look(None)
        grasp = RopeGrasp(env, robot=env.scene.robot("panda"), rope=cable)
        grasp.begin(everyone)
        for _ in range(4):  # it is asked again before it gives up
            grasp.act(everyone, np.zeros((1, env.action_dim)))
        assert OUTCOMES[grasp.outcome[0]] is Outcome.NO_IK
