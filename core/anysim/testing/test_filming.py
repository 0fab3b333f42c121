"""Pictures of an earlier moment: drawn from recorded body poses, they are those that were drawn then, to the pixel."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.capability import Capabilities, Capability as C
from anysim.errors import EngineError
from anysim.math import pose as P
from anysim.model.world import Camera, Light, Scenery, World
from anysim.testing import looks, worlds
from anysim.testing.compare import assert_same, play, read, tape
from anysim.testing.fixtures import needs
from anysim.testing.varying import FULL, having, varied

CHANNELS = {"rgb": C.RENDER_RGB, "depth": C.RENDER_DEPTH, "segmentation": C.RENDER_SEGMENTATION}


def filmed(capabilities: Capabilities) -> World:
    """A world with all that an engine can show: things that may be absent, textures, lights, and a camera that rides.

    The camera `eye` is on the box, which falls and turns.
    """
    world = varied(capabilities, cameras=True) if C.VARYING_ENTITIES in capabilities else worlds.scene(cameras=True)
    box = next(i for i, body in enumerate(world.bodies) if body.name == "box")
    away = tuple(float(v) for v in P.look_at(np.zeros(3), np.array([-0.4, -0.1, 0.05])))
    shown = tuple(channel for channel, capability in CHANNELS.items() if capability in capabilities)
    eye = Camera("eye", box, (0.0, 0.0, 0.1), away, 70.0, 48, 64, shown)  # pyright: ignore[reportArgumentType]
    cameras = (*(replace(camera, channels=shown) for camera in world.cameras), eye)
    world = replace(world, cameras=cameras, scenery=Scenery((0.2, 0.3, 0.5), (0.3, 0.3, 0.4), False))
    if C.RENDER_LIGHTS in capabilities:
        sun = Light("sun", (0.0, 0.6, -0.8), None, (1.0, 0.9, 0.8), 0.6)
        world = replace(world, lights=(sun, Light("lamp", (0.0, 0.0, -1.0), (0.0, 0.5, 2.0), (0.5, 0.6, 1.0), 0.3)))
    return replace(world, textures=looks.TEXTURES, materials=looks.MATERIALS) if C.TEXTURES in capabilities else world


def dress(engine: SimEngine) -> None:
    """Give every env a presence, colours, textures, lights and lenses of its own, where the engine has them."""
    world, rng = engine.world, np.random.default_rng(5)
    if world.slots:
        engine.reset(present=np.concatenate([having(world, *FULL), having(world, "mug~2", "post")]))

    def change(name: str, draw: Array) -> None:
        if name in engine.parameters and draw.size:
            engine.set_parameters(name, draw)

    n, geoms, lights = engine.num_envs, len(world.geoms), len(world.lights)
    opaque = np.ones((n, geoms, 1))
    change("geom.color", np.concatenate([rng.uniform(0.1, 0.9, (n, geoms, 3)), opaque], axis=2))
    for name, kinds in (("texture", world.textures), ("material", world.materials)):
        if kinds:
            change(f"geom.{name}", rng.integers(-1, len(kinds), (n, geoms)).astype(float))
    change("light.direction", rng.uniform(-0.5, 0.5, (n, lights, 3)) - [0.0, 0.0, 1.0])
    change("light.intensity", rng.uniform(0.2, 0.8, (n, lights)))
    change("world.background", rng.uniform(0.0, 1.0, (n, 1, 3)))
    change("world.ambient", rng.uniform(0.1, 0.4, (n, 1, 3)))
    if C.RENDER_SHADOWS in engine.capabilities:
        change("world.shadows", np.array([[1.0], [0.0]]))
    engine.set_camera_fov("eye", rng.uniform(50.0, 80.0, n))


def film(engine: SimEngine, body_pose: Array | None = None) -> dict[str, Array]:
    """All channels of all cameras, of now or of then."""
    pictures: dict[str, Array] = {}
    for camera in engine.world.cameras:
        images = engine.render(camera.name, channels=camera.channels, body_pose=body_pose)
        pictures |= {f"{camera.name} {channel}": image for channel, image in images.items()}
    return pictures


def run(engine: SimEngine, seed: int) -> None:
    """Some motion, where the engine moves things: drives wander, and free bodies are thrown."""
    world = engine.world
    free = [i for i, body in enumerate(world.bodies) if body.kind == "free"]
    rng = np.random.default_rng(seed)
    engine.set_body_state(twist=rng.normal(0.0, 0.8, (engine.num_envs, len(free), 6)), bodies=free)
    play(engine, tape(world, list(range(engine.num_envs)), 8, seed), 5)


@needs(C.RENDER_RGB)
def test_recorded_poses_give_the_pictures_of_then(build, engine_class):
    """Of each moment of a run the same pixels, on every channel, after the run and in an engine that never moved."""
    engine, still = (build(filmed(engine_class.capabilities), 2) for _ in range(2))
    for e in (engine, still):
        dress(e)
    moments = []
    for seed in range(4):
        moments.append((np.array(engine.get_state().body_pose), film(engine)))
        run(engine, seed)
    for e in (engine, still):
        for number, (poses, pictures) in enumerate(moments):
            assert_same(film(e, poses), pictures, f"moment {number}")
    if C.DYNAMICS in engine.capabilities:
        first, last = moments[0][1], moments[-1][1]
        assert not np.array_equal(first["eye rgb"], last["eye rgb"]), "the moments must differ to tell them apart"


@needs(C.RENDER_RGB)
def test_drawing_an_earlier_moment_leaves_the_state_alone(build, engine_class):
    """The run goes on with the same bits, and what is drawn next is the present."""
    engine, clean = (build(filmed(engine_class.capabilities), 2) for _ in range(2))
    for e in (engine, clean):
        dress(e)
    then = np.array(engine.get_state().body_pose)
    for seed in range(3):
        run(engine, seed)
        run(clean, seed)
        film(engine, then)
        assert_same(read(engine), read(clean), "right after drawing")
        assert_same(film(engine), film(clean), "the present after the past")
    run(engine, 7)
    run(clean, 7)
    assert_same(read(engine), read(clean), "later on")


@needs(C.RENDER_RGB)
def test_an_earlier_moment_of_some_envs(build, engine_class):
    """Rows belong to the envs named, in their order, with what each env shows."""
    engine = build(filmed(engine_class.capabilities), 2)
    dress(engine)
    run(engine, 0)
    then, wanted = np.array(engine.get_state().body_pose), engine.render("eye")["rgb"]
    run(engine, 1)
    swapped = engine.render("eye", env_ids=[1, 0], body_pose=then[[1, 0]])["rgb"]
    assert np.array_equal(swapped, wanted[[1, 0]])
    assert np.array_equal(engine.render("eye", env_ids=[1], body_pose=then[[1]])["rgb"], wanted[[1]])


@needs(C.RENDER_RGB)
def test_poses_that_cannot_be_drawn_are_refused(build):
    """Another number of bodies, what is not finite, and quaternions that are not of unit length."""
    engine = build(worlds.scene(cameras=True))
    poses = np.array(engine.get_state().body_pose)
    with pytest.raises(EngineError, match="body_pose must have shape"):
        engine.render("front", body_pose=poses[:, :-1])
    for value, words in ((np.nan, "not finite"), (3.0, "unit length")):
        wrong = poses.copy()
        wrong[0, 0, 4] = value
        with pytest.raises(EngineError, match=words):
            engine.render("front", body_pose=wrong)
