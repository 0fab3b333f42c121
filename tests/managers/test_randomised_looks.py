"""Lights, surroundings, cameras and images that differ between episodes: drawn, read back, and seen."""

from math import radians, sqrt, tan
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.api import check_engine, compile_world, load
from anysim.engine.factory import engine_class
from anysim.errors import CapabilityError, SpecError
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_drawing
from anysim_inspect.draws import explain

ENGINES = ("mujoco", "pybullet", "sapien")
SCENE: dict[str, Any] = {
    "world": {
        "name": "studio",
        "terrain": "none",
        "objects": {
            "slab": {"source": {"box": [1.0, 1.0, 0.2]}, "fixed": True, "color": [0.6, 0.6, 0.6]},
            "ball": {"source": {"sphere": 0.2}, "fixed": True, "color": "red"},
        },
        "layout": {"slab": {"position": [0.0, 0.0, -0.1]}, "ball": {"position": [0.0, 0.0, 2.0]}},
        "cameras": {
            "top": {"from": [0.0, 0.0, 1.0], "look_at": [0.0, 0.001, 0.0], "fov": 80.0, "size": [48, 48]},
            "side": {
                "from": {"range": [[2.0, -0.5, 2.0], [3.0, 0.5, 2.5]]}, "look_at": "ball",
                "fov": {"range": [20.0, 60.0]}, "size": [128, 128], "channels": ["segmentation"],
            },
        },
        "lights": {"key": {"direction": [0.0, 0.0, -1.0], "intensity": {"range": [0.1, 0.8]}}},
        "scenery": {"ambient": [0.2, 0.2, 0.2], "background": {"range": [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]}},
    },
    "task": {"observations": {"policy": [{"term": "frame_pose", "frame": "ball"}]}, "images": {"top": {}}},
}  # fmt: skip


def studio(engine: str, n: int, *overrides: str, scene: dict[str, Any] = SCENE) -> TaskEnv:
    return anysim.make(scene, engine=engine, num_envs=n, overrides=overrides)


def changed(**world: Any) -> dict[str, Any]:
    """The studio with other parts of its world, and nothing left of those that it has."""
    return {**SCENE, "world": {**SCENE["world"], **world}}


def started(env: TaskEnv, seed: int = 0) -> dict[str, np.ndarray]:
    """The first observation; skips where this machine draws no images."""
    require_drawing(env.engine.name)
    return env.reset(seed=seed)[0]


def drawn(env: TaskEnv, name: str) -> Any:
    return np.array([draws[name] for draws in env.streams.draws])


@pytest.mark.parametrize("engine", ENGINES)
def test_light_and_background_are_those_that_were_drawn(engine: str) -> None:
    with studio(engine, 6) as env:
        images = started(env)["images/top"].astype(float)
        strength, background = drawn(env, "light/key/intensity"), drawn(env, "light/scenery.background")
        assert np.allclose(env.engine.get_parameters("light.intensity")[:, 0], strength)
        assert np.allclose(env.engine.get_parameters("world.background")[:, 0], background)
        assert np.abs(images[:, 1, 1] - 255 * background).max() <= 1
        middle = images[:, 24, 24].mean(axis=-1)
        slope, rest = np.polyfit(strength, middle, 1)
        assert np.allclose(slope * strength + rest, middle, atol=1.0)  # light adds up
        assert slope == pytest.approx(0.6 * 255, rel=0.12)  # the colour times the light, and a little shine
        assert rest == pytest.approx(0.6 * 0.2 * 255, abs=16)  # the ambient light, and MuJoCo's lamp beside the viewer


@pytest.mark.parametrize("engine", ENGINES)
def test_a_light_from_the_side_shines_less_and_in_its_colour(engine: str) -> None:
    light = (
        "world.lights.key={direction: {choice: [[0, 0, -1], [1, 0, -1]]}, color: {choice: [white, yellow]},"
        " intensity: 0.6}"
    )
    with studio(engine, 12, light) as env:
        images = started(env, 1)["images/top"].astype(float)[:, 24, 24]
        tilted = drawn(env, "light/key/direction")[:, 0] > 0
        yellow = np.array([d["light/key/color"] == "yellow" for d in env.streams.draws])
        assert {(a, b) for a, b in zip(tilted, yellow, strict=True)} == {(a, b) for a in (0, 1) for b in (0, 1)}
        assert np.ptp(images[yellow & tilted], axis=0).max() <= 1
        straight, aside = images[~tilted & ~yellow][0], images[tilted & ~yellow][0]
        dark = 0.6 * 255 * 0.6
        assert np.allclose(straight - aside, dark * (1 - 1 / sqrt(2)), atol=0.12 * dark)
        gone = images[~tilted & ~yellow][0] - images[~tilted & yellow][0]
        assert np.abs(gone[:2]).max() <= 3
        assert gone[2] == pytest.approx(dark, rel=0.12)


def test_five_lights_add_up_on_an_engine_that_has_them() -> None:
    lamps = {f"l{i}": {"direction": [0.0, 0.0, -1.0], "intensity": 0.1} for i in range(5)}
    dark = {"ambient": [0.0, 0.0, 0.0], "background": "black"}
    with studio("sapien", 1, scene=changed(lights=lamps, scenery=dark)) as env:
        image = started(env)["images/top"]
        assert np.abs(image[0, 24, 24].astype(float) - 0.6 * 0.5 * 255).max() <= 1


def test_shadows_are_drawn_where_the_episode_has_them() -> None:
    """A ball over the slab hides the light, or does not."""
    world = changed(
        scenery={"shadows": {"choice": [True, False]}, "background": "grey"},
        lights={"key": {"direction": [-1.0, 0.0, -1.0], "intensity": 0.6}},
        layout={"slab": {"position": [0.0, 0.0, -0.1]}, "ball": {"position": [0.3, 0.0, 0.4]}},
    )
    with studio("mujoco", 8, "world.cameras.top.from=[-0.3, 0.0, 1.2]", scene=world) as env:
        images = started(env, 2)["images/top"].astype(float)
        cast = drawn(env, "light/scenery.shadows").astype(bool)
        assert 0 < cast.sum() < 8
        difference = images[~cast].mean(axis=(0, 3)) - images[cast].mean(axis=(0, 3))
        assert 40 < (difference > 30).sum() < 400  # a patch of 0.2 m x 0.28 m, 24 pixels a metre
        assert np.median(np.abs(difference)) < 2


@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
def test_shadows_are_refused_where_the_engine_does_not_draw_them_well(engine: str) -> None:
    loaded = load(SCENE, overrides=["world.scenery.shadows={choice: [true, false]}"])
    with pytest.raises(CapabilityError, match=rf"world\.scenery\.shadows.*{engine} cannot change 'world\.shadows'"):
        check_engine(loaded, compile_world(loaded), engine_class(engine), "studio")


def test_a_world_with_shadows_needs_an_engine_that_draws_them() -> None:
    loaded = load(SCENE, overrides=["world.scenery.shadows=true"])
    with pytest.raises(CapabilityError, match=r"camera 'top' shows shadows \(render: shadows\)"):
        check_engine(loaded, compile_world(loaded), engine_class("sapien"), "studio")


@pytest.mark.parametrize("engine", ENGINES)
def test_a_ball_is_as_large_as_the_lens_and_the_place_that_were_drawn_say(engine: str) -> None:
    """The outline of a ball in the middle of a picture is a circle of radius f r / sqrt(d^2 - r^2)."""
    with studio(engine, 5) as env:
        started(env)
        eye, fov = drawn(env, "camera/side/from"), drawn(env, "camera/side/fov")
        assert np.allclose(env.engine.camera_poses("side")[:, :3], eye)
        assert np.allclose(env.engine.camera_fov("side"), fov)
        seen = env.engine.render("side", channels=("segmentation",))["segmentation"]
        area = (seen == env.engine.index.segmentation_id("ball")).sum(axis=(1, 2))
        distance = np.linalg.norm(eye - [0.0, 0.0, 2.0], axis=1)
        radius = np.array([64 / tan(radians(f) / 2) for f in fov]) * 0.2 / np.sqrt(distance**2 - 0.2**2)
        assert np.abs(np.sqrt(area / np.pi) - radius).max() < 1.0
        rows, columns = (np.array([np.argwhere(s == 2).mean(axis=0)[k] for s in seen]) for k in (0, 1))
        assert np.abs(np.stack([rows, columns]) - 63.5).max() < 1.0


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_snapshots_and_shards_have_the_lens_and_the_light(engine: str) -> None:
    with studio(engine, 4) as env:
        started(env)
        before = env.obs["images/top"], env.engine.camera_fov("side")
        kept = env.snapshot()
        env.reset()
        assert not np.array_equal(env.obs["images/top"], before[0])
        again = env.reset_to(kept)["images/top"]
        assert np.array_equal(again, before[0])
        assert np.array_equal(env.engine.camera_fov("side"), before[1])


@pytest.mark.slow
def test_images_do_not_depend_on_shards() -> None:
    with studio("pybullet", 4, "engine.shards=2") as two, studio("pybullet", 4) as one:
        a, b = started(two)["images/top"], started(one)["images/top"]
        assert np.array_equal(a, b)
        shots = [env.engine.render("side", channels=("segmentation",))["segmentation"] for env in (two, one)]
        assert np.array_equal(*shots)


# ---------------------------------------------------------------------- what is captured

EXPOSED = "world.cameras.top.exposure={range: [0.5, 1.5]}"
NOISY = "world.cameras.top.noise={choice: [0.0, 0.05]}"
STEADY = ("world.lights.key.intensity=0.3", "world.scenery.background=[0.5, 0.5, 0.5]")


def test_exposure_and_noise_are_those_that_were_drawn() -> None:
    with studio("mujoco", 8, EXPOSED, NOISY, *STEADY) as env, studio("mujoco", 8, *STEADY) as plain:
        seen, clean = (started(e)["images/top"].astype(float)[:, 20:28, 20:28] for e in (env, plain))
        exposure, noise = drawn(env, "capture/top/exposure"), drawn(env, "capture/top/noise")
        assert {*noise} == {0.0, 0.05}
        error = seen - clean * exposure[:, None, None, None]
        assert np.abs(error[noise == 0]).max() <= 0.5
        assert np.allclose(error[noise > 0].std(axis=(1, 2, 3)), 0.05 * 255, rtol=0.25)
        first = env.engine.render("top")["rgb"]
        assert np.array_equal(first, plain.engine.render("top")["rgb"])  # the world itself is as it was


def test_image_noise_is_new_at_each_step_and_the_same_again() -> None:
    runs = []
    for n in (1, 3):
        with studio("mujoco", n, "world.cameras.top.noise=0.05", *STEADY) as env:
            first = started(env)["images/top"][0]
            second = env.step(np.zeros((n, 0))).obs["images/top"][0]
            assert not np.array_equal(first, second)
            runs.append((first, second))
    assert np.array_equal(runs[0], runs[1])


def test_an_image_holds_until_the_next_is_due() -> None:
    """Ten images a second at fifty control steps: every fifth."""
    with studio("mujoco", 1, "world.cameras.top.noise=0.05", "task.images.top.fps=10.0") as env:
        started(env)
        images = [env.obs["images/top"]]
        kept = None
        for step in range(1, 11):
            images.append(env.step(np.zeros((1, 0))).obs["images/top"])
            kept = env.snapshot() if step == 7 else kept
        changes = [k for k in range(1, 11) if not np.array_equal(images[k], images[k - 1])]
        assert changes == [5, 10]
        env.reset()
        assert kept is not None
        assert np.array_equal(env.reset_to(kept)["images/top"], images[7])
        rest = [env.step(np.zeros((1, 0))).obs["images/top"] for _ in range(3)]
        assert np.array_equal(rest, images[8:])


def test_nothing_is_drawn_where_no_image_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    unseen = {**SCENE, "task": {"observations": SCENE["task"]["observations"]}}
    with studio("mujoco", 2, scene=unseen) as env:
        monkeypatch.setattr(type(env.engine), "render", lambda *_, **__: pytest.fail("an image was taken"))
        env.reset(seed=0)
        env.step(np.zeros((2, 0)))


def test_the_observation_space_has_the_images() -> None:
    gym = pytest.importorskip("gymnasium")
    from anysim_learning.gymnasium import observation_space

    with studio("mujoco", 1) as env:
        space = observation_space(env)["images/top"]
        assert isinstance(space, gym.spaces.Box)
        assert (space.shape, space.dtype) == ((48, 48, 3), np.uint8)
        assert observation_space(env).contains({k: v[0] for k, v in started(env).items()})


# ---------------------------------------------------------------------- words


def test_every_draw_is_explained_by_its_line() -> None:
    found = {d.name: d.path for d in explain(SCENE, overrides=[EXPOSED]).draws}
    assert found == {
        "light/key/intensity": "world.lights.key.intensity",
        "light/scenery.background": "world.scenery.background",
        "camera/side/from": "world.cameras.side.from",
        "camera/side/fov": "world.cameras.side.fov",
        "capture/top/exposure": "world.cameras.top.exposure",
    }


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("world.lights.key.direction={range: [[-1, 0, 0], [1, 0, 0]]}", "choose bounds whose middle is not zero"),
        ("world.lights.key.color={choice: [white, purpel]}", "did you mean 'purple'"),
        ("world.scenery.background=bleu", "did you mean 'blue'"),
        ("world.scenery.shadows={range: [false, true]}", "shadows"),
        ("world.cameras.side.fov={range: [20, 200]}", "fov"),
    ],
)
def test_what_cannot_be_is_said_with_its_place(override: str, words: str) -> None:
    with pytest.raises(SpecError) as caught:
        compile_world(load(SCENE, overrides=[override]))
    assert words in str(caught.value)


def test_a_camera_stands_in_the_scene_of_its_env() -> None:
    """Where an env's scene stands elsewhere on the ground, its cameras do too."""
    with studio(
        "null",
        2,
        "task.images={}",
        "world.cameras.top.channels=[]",
        "world.cameras.side.channels=[]",
        scene={**SCENE, "task": {"observations": SCENE["task"]["observations"]}},
    ) as env:
        env.reset(seed=0)
        before = env.engine.camera_poses("top")
        env.managers[0].episodes.origin[1] = [3.0, 0.0, 0.5]
        env.reset(seed=0)
        after = env.engine.camera_poses("top")
        assert np.allclose(after[:, :3] - before[:, :3], [[0.0, 0.0, 0.0], [3.0, 0.0, 0.5]])
        assert np.allclose(after[:, 3:], before[:, 3:])
