"""Physics needs no graphics device; drawing finds one, or says what to do."""

import os
import subprocess
import sys
import textwrap

import numpy as np
import pytest

from anysim.compile.world import compile_world
from anysim.errors import EngineError
from anysim.math import pose as P
from anysim.model.world import Body, BodyKind, Box, Camera, Entity, EntityKind, Geom, Scenery, World
from anysim.testing import worlds
from anysim.testing.engines import require_drawing
from anysim_sapien import diagnosis, vulkan
from anysim_sapien.engine import SapienEngine
from anysim_sapien.options import OWN_SCENERY
from anysim_schemas.run import WorldSpec

NOTHING = "/no/such/driver.json"


def run(code, **env):
    """A program in a process without any Vulkan driver."""
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", textwrap.dedent(code)],
        env={**os.environ, **env},
        text=True,
        capture_output=True,
        timeout=120,
        check=False,
    )


def test_physics_without_a_vulkan_device():
    """A world with visible geoms and cameras runs, drawing is an EngineError with a remedy, and the process lives on.

    With render objects in the physics scene SAPIEN would raise at the build, or end the process.
    """
    code = """
        from anysim.engine.factory import create_simulation
        from anysim.errors import EngineError
        from anysim.testing import worlds
        engine = create_simulation("sapien").create_world(worlds.scene(cameras=True), 2)
        engine.step(20)
        for _ in range(2):
            try:
                engine.render("front")
            except EngineError as error:
                print(error)
        engine.reset()
        engine.step(5)
        engine.destroy()
        print("alive")
    """
    done = run(code, VK_ICD_FILENAMES=NOTHING, VK_DRIVER_FILES=NOTHING)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("SAPIEN cannot draw here") == 2
    assert "apt-get install chromium" in done.stdout
    assert done.stdout.rstrip().endswith("alive")


def test_physics_does_not_touch_rendering(make, monkeypatch):
    """Nothing of `sapien.render` is made until an image is asked for."""
    from anysim_sapien.library import sapien

    def refuse(*_, **__):
        raise AssertionError("physics made a render object")

    for name in ("RenderSystem", "RenderMaterial", "RenderBodyComponent"):
        monkeypatch.setattr(sapien.render, name, refuse)
    engine = make(worlds.scene(cameras=True))
    engine.step(3)
    engine.reset()


def test_the_driver_that_is_chosen(monkeypatch, tmp_path):
    """The environment's driver, else the system's, else Chromium's; an option names another, or none."""
    system, software = tmp_path / "icd.d", tmp_path / "swiftshader.json"
    system.mkdir()
    for name in vulkan.VARIABLES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(vulkan, "SYSTEM", (str(system),))
    monkeypatch.setattr(vulkan, "SOFTWARE", (str(tmp_path / "missing.json"), str(software)))
    assert vulkan.driver_file("auto") == ""
    software.write_text("{}")
    assert vulkan.driver_file("auto") == str(software)
    assert vulkan.driver_file(str(software)) == str(software)
    (system / "card.json").write_text("{}")
    assert vulkan.driver_file("auto") == ""
    (system / "card.json").unlink()
    monkeypatch.setenv("VK_DRIVER_FILES", "mine.json")
    assert vulkan.driver_file("auto") == ""
    with pytest.raises(EngineError, match="vulkan_icd=none"):
        vulkan.driver_file("none")
    with pytest.raises(EngineError, match="no Vulkan driver file"):
        vulkan.driver_file(NOTHING)


def test_the_doctor_names_the_driver_and_how_to_choose_it(monkeypatch, tmp_path):
    """What the environment names, what the system has, what Chromium brings, or what to install."""
    system, software = tmp_path / "icd.d", tmp_path / "swiftshader.json"
    system.mkdir()
    for name in vulkan.VARIABLES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(vulkan, "SYSTEM", (str(system),))
    monkeypatch.setattr(vulkan, "SOFTWARE", (str(software),))
    none = diagnosis.driver()
    assert (none.state, none.remedy) == ("missing", vulkan.REMEDY)
    software.write_text("{}")
    assert f"vulkan_icd={software}" in diagnosis.driver().remedy
    (system / "card.json").write_text("{}")
    assert str(system / "card.json") in diagnosis.driver().found
    monkeypatch.setenv("VK_ICD_FILENAMES", str(tmp_path / "gone.json"))
    gone = diagnosis.driver()
    assert (gone.state, gone.remedy) == ("broken", "unset VK_ICD_FILENAMES")


def test_a_driver_in_software_gets_the_cheap_shader(make):
    """SwiftShader does not call itself a CPU; SAPIEN's own shader takes half a minute to its first image there."""
    require_drawing("sapien")
    engine = make(worlds.scene(cameras=True))
    where = engine.renderer_name().rpartition(", ")[2]
    device = vulkan.open_device("auto")
    computes = any(word in device.name.lower() for word in ("swiftshader", "llvmpipe"))
    assert device.is_cpu == computes
    assert where == ("in software" if computes else "on the GPU")
    painter = engine._envs.painter()
    assert painter._shader == ("lit" if computes else "default")


def test_faces_are_as_bright_as_light_falls_on_them():
    """Lambert's law: the sun shines along (0, 0.6, -0.8), so of a white box the top has 0.8 of it and a side 0.6."""
    box = {"source": {"box": [0.2, 0.2, 0.2]}, "color": [0.5, 0.5, 0.5], "fixed": True}
    spec = {
        "objects": {"box": box}, "layout": {"box": {"position": [0, 0, 0.1]}}, "terrain": "none",
        "lights": {"sun": {"direction": [0.0, 0.6, -0.8]}},
        "cameras": {"front": {"from": [0.0, -0.6, 0.7], "look_at": "box", "size": [120, 120]}},
    }  # fmt: skip
    require_drawing("sapien")
    with SapienEngine(shader="lit").create_world(compile_world(WorldSpec.model_validate(spec))) as engine:
        images = engine.render("front", channels=("rgb", "segmentation"))
    image, seen = images["rgb"][0], images["segmentation"][0]
    assert (image[seen == 0] == np.rint(np.array(OWN_SCENERY.background) * 255)).all()
    side, top = np.unique(image[seen == 1][:, 0])  # the side that the sun is behind is not in the picture
    ambient = OWN_SCENERY.ambient[0] * 0.5 * 255
    assert (top - ambient) / (side - ambient) == pytest.approx(0.8 / 0.6, rel=0.03)


def test_drawing_leaves_the_environment_alone(make):
    """The driver's name is in the environment only while it is loaded."""
    require_drawing("sapien")
    before = dict(os.environ)
    make(worlds.scene(cameras=True)).render("front")
    assert dict(os.environ) == before


def test_one_scene_draws_all_envs(make):
    """Envs in different states and colours look different, in any order."""
    require_drawing("sapien")
    engine = make(worlds.scene(cameras=True), 2)
    box = engine.index.body("box")
    engine.set_body_state(pose=[0.8, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0], env_ids=[1], bodies=[box])
    both = engine.render("front", channels=("rgb", "segmentation"))
    assert not np.array_equal(both["segmentation"][0], both["segmentation"][1])
    swapped = engine.render("front", env_ids=[1, 0], channels=("rgb", "segmentation"))
    assert np.array_equal(swapped["rgb"], both["rgb"][::-1])
    assert np.array_equal(swapped["segmentation"], both["segmentation"][::-1])


@pytest.mark.slow
def test_drawing_says_nothing(make):
    """The first image of a process writes nothing to its standard error: software drivers warn of what they lack."""
    require_drawing("sapien")
    make(worlds.scene(cameras=True)).render("front")
    code = """
        from anysim.engine.factory import create_simulation
        from anysim.testing import worlds
        with create_simulation("sapien").create_world(worlds.scene(cameras=True)) as engine:
            engine.render("front", channels=("rgb", "depth", "segmentation"))
    """
    done = run(code)
    assert done.returncode == 0
    assert done.stderr == ""
    assert done.stdout == ""


def test_what_a_driver_says_is_in_the_error(monkeypatch):
    """Where no device opens, the driver's own words are in the message."""
    from anysim_sapien.library import sapien

    def fail():
        os.write(2, b"vk: the card is on fire\n")
        raise RuntimeError("no device")

    monkeypatch.setattr(vulkan, "_opened", None)
    monkeypatch.setattr(sapien.render, "RenderSystem", fail)
    with pytest.raises(EngineError, match="no device; vk: the card is on fire; driver: "):
        vulkan.open_device("auto")


@pytest.mark.parametrize(("reach", "pixels"), [(1.0, 0.04), (10.0, 0.25)])
@pytest.mark.parametrize("size", [(29, 20), (116, 80)])
def test_depth_is_that_of_a_point_beside_the_middle_of_a_pixel(make, reach, pixels, size):
    """As declared, on a tilted slab that is all in the image, or reaches behind the camera."""
    require_drawing("sapien")
    tilt, eye = P.from_axis_angle(np.array([0.6, 0.8, 0.0]), np.array(0.3)), np.array([1.2, 0.5, 0.8])
    look, (width, height) = P.look_at(eye, np.array([0.0, 0.0, 0.1])), size
    slab = Geom("slab", 0, Box((reach, reach, 0.1)))
    world = World(
        "slab",
        bodies=(Body("slab", BodyKind.STATIC, quaternion=tuple(tilt)),),
        geoms=(slab,),
        entities=(Entity("slab", EntityKind.OBJECT, 0, 1, 0, 0),),
        cameras=(Camera("eye", -1, tuple(eye), tuple(look), 60.0, width, height, far=100.0),),
    )
    depth = make(world).render("eye", channels=("depth",))["depth"][0].astype(float)
    focal, turn = height / 2 / np.tan(np.radians(30.0)), P.to_matrix(look)
    up = P.to_matrix(tilt)[:, 2]

    def answer(u, v):
        along = np.stack([(u - width / 2) / focal, (v - height / 2) / focal, np.ones_like(u)], axis=-1) @ turn.T
        there = ((0.1 * up - eye) @ up) / (along @ up)
        return there, np.abs(P.rotate_inverse(tilt, eye + along * there[..., None])[..., :2]).max(axis=-1)

    u, v = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    right, place = answer(u, v)
    beside = np.hypot((answer(u + 0.5, v)[0] - answer(u - 0.5, v)[0]), answer(u, v + 0.5)[0] - answer(u, v - 0.5)[0])
    seen = (right > 0) & (place < 0.9 * reach) & np.isfinite(depth)
    assert seen.mean() > 0.3
    assert np.percentile((np.abs(depth - right) / beside)[seen], 98) < pixels


@pytest.mark.parametrize("shader", ["lit", "trivial"])
def test_the_background_is_seen_through_glass(make, shader):
    """A black pane of half opacity, with nothing behind it: half of the background's light, not black."""
    require_drawing("sapien")
    eye = np.array([0.0, 0.0, 2.0])
    world = World(
        "pane",
        bodies=(Body("pane", BodyKind.STATIC),),
        geoms=(Geom("pane", 0, Box((0.2, 0.2, 0.01)), color=(0.0, 0.0, 0.0, 0.5)),),
        entities=(Entity("pane", EntityKind.OBJECT, 0, 1, 0, 0),),
        cameras=(Camera("eye", -1, tuple(eye), tuple(P.look_at(eye, np.zeros(3))), 40.0, 33, 33),),
        scenery=Scenery(background=(0.2, 0.6, 1.0)),
    )
    image = make(world, shader=shader).render("eye")["rgb"][0]
    assert image[0, 0].tolist() == [51, 153, 255]
    assert image[16, 16] / 255 == pytest.approx([0.1, 0.3, 0.5], abs=0.08)  # and what shines on it
