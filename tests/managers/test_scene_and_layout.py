"""Objects and their places, episode by episode."""

import numpy as np
import pytest

from anysim.errors import TaskError
from tests.task.helpers import blocks


def test_objects_stand_on_their_support_within_their_ranges() -> None:
    with blocks(32) as env:
        env.reset(seed=0)
        pose = env.engine.get_state().body_pose
        red, ball = (pose[:, env.engine.index.body(name)] for name in ("red", "ball"))
        assert np.allclose(red[:, 2], 0.4 + 0.025)
        assert np.allclose(ball[:, 2], 0.4 + 0.03)
        assert (np.abs(red[:, :2]) <= 0.4).all()
        assert len(np.unique(red[:, 0])) == 32
        gap = np.linalg.norm(red[:, :3] - ball[:, :3], axis=1)
        assert gap.min() > 0.05 + 0.03 + 0.025


def test_a_crowded_layout_names_both_objects() -> None:
    with (
        blocks(1, "world.layout.ball.clearance=3.0") as env,
        pytest.raises(TaskError, match=r"no place for 'ball'.*from 'red'"),
    ):
        env.reset(seed=0)


def test_masses_friction_and_colours_vary_and_are_noted() -> None:
    with blocks(16) as env:
        env.reset(seed=0)
        body = env.engine.index.body("red")
        mass = env.engine.get_parameters("body.mass", indices=[body])[:, 0]
        inertia = env.engine.get_parameters("body.inertia", indices=[body])[:, 0]
        assert (mass >= 0.1).all()
        assert (mass <= 0.4).all()
        assert len(np.unique(mass)) == 16
        assert np.allclose(inertia[:, 0], mass * (0.05**2 + 0.05**2) / 12)
        drawn = [d["scene/red/mass"] for d in env.streams.draws]
        assert np.allclose(drawn, mass)
        geom = env.engine.index.geoms_of(env.engine.index.entity("red"))
        colors = {tuple(c) for c in env.engine.get_parameters("geom.color", indices=geom)[:, 0]}
        assert colors == {(1.0, 0.0, 0.0, 1.0), (0.0, 0.0, 1.0, 1.0)}


def test_an_additional_random_value_moves_no_other() -> None:
    with blocks(4) as plain, blocks(4, "world.objects.ball.mass={range: [0.1, 0.5]}") as more:
        plain.reset(seed=2)
        more.reset(seed=2)
        for a, b in zip(plain.streams.draws, more.streams.draws, strict=True):
            assert {k: v for k, v in b.items() if not k.startswith("scene/ball")} == a


def test_cameras_that_look_at_an_object_are_aimed_at_it() -> None:
    with blocks(4) as env:
        env.reset(seed=0)
        pose = env.engine.camera_poses("eye")
        red = env.engine.get_state().body_pose[:, env.engine.index.body("red"), :3]
        from anysim.math.pose import norm, rotate

        forward = rotate(pose[:, 3:], np.tile([0.0, 0.0, 1.0], (4, 1)))
        wanted = red - pose[:, :3]
        assert np.allclose(forward, wanted / norm(wanted)[:, None], atol=1e-9)
