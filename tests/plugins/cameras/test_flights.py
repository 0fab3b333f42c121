"""Skills of flying cameras: ways around things, what they refuse, and how much of a thing a view shows."""

from typing import Any

import numpy as np
import pytest

import anysim
from anysim.conventions import Array
from anysim.errors import AnysimError
from anysim.math import pose as P
from anysim.skills.runner import SkillPolicy
from anysim.task.scene import ObjectView
from anysim.testing.engines import require_drawing, require_engine
from anysim_tasks.camera.terms import Unhidden
from tests.tasks.camera_paths import put_camera
from tests.tasks.states import blind, seen

HULL = 0.08


def _outside_box(points: Array, pose: Array, half: Array) -> Array:
    """Distances (n,) of points to boxes at poses (n, 7), negative inside."""
    apart = np.abs(P.rotate_inverse(pose[:, 3:], points - pose[:, :3])) - half
    return P.norm(np.maximum(apart, 0.0)) + np.minimum(apart.max(axis=1), 0.0)


@pytest.mark.slow
def test_ways_keep_clear_of_things() -> None:
    """32 flights past furniture: the least distance from the lens to it is the hull's and the clearance, nearly."""
    require_engine("mujoco")
    halves = {"shelf": [0.175, 0.7, 0.95], "table": [0.5, 0.35, 0.375], "case": [0.25, 0.25, 0.65]}
    with blind("camera_goto", "mujoco", 32) as env:
        env.reset(seed=77)
        policy, everyone = SkillPolicy(env), np.arange(32)
        least, straight = np.full(32, np.inf), np.full(32, np.inf)
        boxes = {name: seen(env, name) for name in halves}
        first, last = seen(env, "cam.roll_link")[:, :3], seen(env, "goal")[:, :3]

        def nearest(points: Array) -> Array:
            return np.min([_outside_box(points, boxes[n], np.array(h)) for n, h in halves.items()], axis=0)

        for share in np.linspace(0.0, 1.0, 101):
            straight = np.minimum(straight, nearest(first + share * (last - first)))
        fastest = np.zeros(32)
        while env.running.any():
            running = env.running.copy()
            env.step(policy.act(everyone), env.running)
            least[running] = np.minimum(least, nearest(seen(env, "cam.roll_link")[:, :3]))[running]
            env.scene.look(None)
            fastest = np.maximum(fastest, P.norm(env.scene.frame("cam.roll_link").twist[:, :3]))
        assert (straight < HULL).sum() > 8, "many straight ways would not do"
        assert least.min() > HULL + 0.03
        assert fastest.max() < 1.25
        assert (np.array(env.status.tolist()) == "success").all()


def test_what_is_not_hidden_is_what_the_segmentation_shows() -> None:
    """Views of the gift past the board: the share by rays, and that of the pixels that are left of it."""
    require_drawing("mujoco")
    size = ["world.cameras.eye.size=[640, 480]", "record.cameras=[]"]
    with anysim.make("camera_look_at", engine="mujoco", num_envs=1, overrides=size) as env:
        rng, shares = np.random.default_rng(4), []
        for number in range(16):
            env.reset(seed=number)
            gift, base = seen(env, "gift")[:, :3], seen(env, "cam")
            way = np.array([-0.8, *rng.uniform(-0.5, 0.5, 1), *rng.uniform(0.05, 0.5, 1)])
            eye = gift + way / np.linalg.norm(way) * 0.8
            local, aim = (P.rotate_inverse(base[:, 3:], one - base[:, :3]) for one in (eye, gift))
            ahead = (aim - local)[0]
            turn = [np.arctan2(ahead[1], ahead[0]), np.arctan2(-ahead[2], np.hypot(ahead[0], ahead[1])), 0.0]
            put_camera(env, np.array([[*local[0], *turn]]))
            views = {name: ObjectView(env.scene, name) for name in ("gift", "board", "table")}
            rays = Unhidden(env.scene, camera="eye", object=views["gift"], behind=views["board"], also=views["table"])
            share, ids = float(rays.seen()[0]), env.engine.index.segmentation_ids("gift")
            here = np.isin(env.engine.render("eye", channels=("segmentation",))["segmentation"], ids).sum()
            for name in ("board", "table"):
                root = env.engine.index.entity(name).root
                env.engine.set_body_state(np.array([[[9.0, 9, 9, 0, 0, 0, 1]]]), None, None, [root])
            alone = np.isin(env.engine.render("eye", channels=("segmentation",))["segmentation"], ids).sum()
            assert share == pytest.approx(here / alone, abs=0.06), number
            shares.append(share)
    assert np.ptp(shares) > 0.5, "some are hidden, some are not"


@pytest.mark.parametrize("channel", ["base", "arm"])
def test_a_camera_is_flown_by_velocities(channel: str) -> None:
    pose: Any = {"controller": "camera_motion", "params": {"command": "pose"}}
    with (
        blind("camera_track_target", "null", 1, f"world.robots.cam.actions.{channel}={pose}") as env,
        pytest.raises(AnysimError, match=rf"'cam\.{channel}' is to be flown by velocities"),
    ):
        SkillPolicy(env)
