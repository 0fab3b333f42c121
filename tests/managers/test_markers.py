"""Goals are marked in pictures and videos on every engine, in observations only where the task asks for it."""

import numpy as np
import pytest

import anysim
from anysim.managers.markers import COLORS
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_drawing
from anysim_learning.gymnasium import observation_space

LOOK = [
    "world.cameras.front={from: [1.2, 0.0, 0.6], look_at: [0.3, 0.0, 0.6], fov: 40, size: [120, 80]}",
    "world.cameras.wrist.channels=[]",
]


def _env(engine: str, *more: str) -> TaskEnv:
    require_drawing(engine)
    env = anysim.make("pick_cube", engine=engine, num_envs=2, overrides=[*LOOK, *more])
    env.reset(seed=1)
    return env


def _goal_pixel(goal: np.ndarray) -> tuple[int, int]:
    """Row and column of a point in the view of `front`, by hand: it looks along -x from 1.2 m."""
    focal = 80 / (2 * np.tan(np.radians(20)))
    away = 1.2 - goal[0]
    return round(40 - focal * (goal[2] - 0.6) / away - 0.5), round(60 + focal * goal[1] / away - 0.5)


@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
def test_a_goal_is_marked_where_it_is(engine: str) -> None:
    with _env(engine) as env:
        marked, plain = env.render("front"), env.render("front", markers=False)
        for index in range(2):
            row, column = _goal_pixel(env.scene.goals["goal"][index])
            rows, columns = np.nonzero((marked[index] != plain[index]).any(axis=-1))
            assert abs(rows.mean() - row) < 1.0
            assert abs(columns.mean() - column) < 1.0
            nearest = np.abs(marked[index].astype(int) - COLORS[0]).sum(axis=-1).min()
            assert nearest < 60, "its rim has the colour of the first goal"
        assert env.capture is not None
        recorded = env.capture.picture("front", np.arange(2))
        assert np.array_equal(recorded, marked)
        assert np.array_equal(env.capture.image("front", np.arange(2)), plain)


def test_observations_are_marked_only_when_asked_and_videos_show_what_was_observed() -> None:
    everyone = np.arange(2)
    for asked in (False, True):
        with _env("mujoco", f"task.images={{front: {{markers: {str(asked).lower()}}}}}") as env:
            plain, marked = env.render("front", markers=False), env.render("front")
            expected = marked if asked else plain
            assert np.array_equal(env.obs["images/front"], expected)
            assert np.array_equal(env.capture.picture("front", everyone), expected)


def test_videos_without_markers() -> None:
    with _env("mujoco", "record.markers=false") as env:
        assert np.array_equal(env.capture.picture("front", np.arange(2)), env.render("front", markers=False))


def test_what_is_behind_the_camera_or_beside_the_image_is_not_drawn() -> None:
    with _env("mujoco") as env:
        for goal in ([3.0, 0.0, 0.6], [0.3, 5.0, 0.6], [0.3, 0.0, -9.0], [1.2, 0.0, 0.6]):
            env.scene.goals["goal"][:, :3] = goal
            assert np.array_equal(env.render("front"), env.render("front", markers=False))


def test_the_overview_of_a_world_without_cameras_is_marked_too() -> None:
    with _env("mujoco", "record.cameras=[]") as env:
        assert (env.render("default") != env.render("default", markers=False)).any()


_ALL = "[rgb, depth, segmentation]"


@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
def test_depth_and_segmentation_are_observed_as_the_engine_gives_them_up_to_the_far_plane(engine: str) -> None:
    channels = f"task.images={{front: {{channels: {_ALL}, fps: 25}}}}"
    with _env(engine, f"world.cameras.front.channels={_ALL}", channels) as env:
        drawn = env.engine.render("front", channels=("rgb", "depth", "segmentation"))
        seen = {"rgb": "images/front", "depth": "images/front/depth", "segmentation": "images/front/segmentation"}
        assert np.isinf(drawn["depth"]).any(), "some of it is nothing"
        far = env.engine.world.cameras[env.engine.index.camera("front")].far
        drawn["depth"] = np.minimum(drawn["depth"], np.float32(far))
        held = {name: drawn[channel] for channel, name in seen.items()}
        for name, images in held.items():
            assert env.obs[name].dtype == images.dtype
            assert env.obs[name].shape[1:] == env.image_shapes[name]
            assert np.array_equal(env.obs[name], images)
        assert np.isfinite(env.obs["images/front/depth"]).all()
        assert env.obs["images/front/segmentation"].any()
        space = observation_space(env)
        assert all(space[name].contains(env.obs[name][0]) for name in held)
        env.step(np.ones((2, env.action_dim)))
        between = env.snapshot()
        env.step(np.ones((2, env.action_dim)))
        assert not np.array_equal(env.obs["images/front/depth"], held["images/front/depth"]), "the next one was due"
        env.reset_to(between)
        for name, images in held.items():
            assert np.array_equal(env.obs[name], images), "the latest one holds between two"
