"""Images: size, colour, distance, identity; from any thread."""

import threading
from dataclasses import replace

import numpy as np
import pytest

from anysim.errors import EngineError
from anysim.math import pose as P
from anysim.model.world import (
    Body,
    BodyKind,
    Box,
    Camera,
    Entity,
    EntityKind,
    Geom,
    HeightField,
    HeightFieldShape,
    Light,
    Plane,
    World,
)
from anysim.testing.engines import require_drawing


@pytest.fixture(scope="module", autouse=True)
def _draws() -> None:
    require_drawing("mujoco")


def _looking_down(height: float = 2.0) -> tuple[float, float, float, float]:
    return tuple(P.look_at(np.array([0.0, 0.0, height]), np.zeros(3)))


def two_boxes(**camera) -> World:
    """A red and a green box of 0.2 m beside each other on the ground, seen from 2 m above; the image's up is +y."""
    bodies, geoms = [], [Geom("ground", -1, Plane(), color=(0.5, 0.5, 0.5, 1.0))]
    entities = []
    for i, (name, x, color) in enumerate((("red", -0.3, (1.0, 0.0, 0.0, 1.0)), ("green", 0.3, (0.0, 1.0, 0.0, 1.0)))):
        bodies.append(Body(name, BodyKind.STATIC, position=(x, 0.0, 0.1)))
        geoms.append(Geom(name, i, Box((0.1, 0.1, 0.1)), color=color))
        entities.append(Entity(name, EntityKind.OBJECT, i, i + 1, 0, 0))
    top = Camera("top", -1, (0.0, 0.0, 2.0), _looking_down(), 40.0, 64, 48, **camera)
    return World("two_boxes", bodies=tuple(bodies), geoms=tuple(geoms), entities=tuple(entities), cameras=(top,))


LEFT, RIGHT, ROW = 22, 42, 24  # where the boxes are in the image


def test_shapes_types_and_sizes(make):
    """As documented, at the camera's size and at others, growing and shrinking."""
    engine = make(two_boxes(), 3)
    for width, height in ((64, 48), (200, 30), (17, 333), (64, 48)):
        images = engine.render("top", width, height, [0, 2], ("rgb", "depth", "segmentation"))
        assert images["rgb"].shape == (2, height, width, 3)
        assert images["depth"].shape == images["segmentation"].shape == (2, height, width)
        assert [images[k].dtype for k in ("rgb", "depth", "segmentation")] == [np.uint8, np.float32, np.int32]
    assert engine.render("default")["rgb"].shape == (3, 480, 640, 3)


def test_colours_are_where_the_boxes_are(make):
    """Red left, green right, grey ground; x to the right and y up in the image."""
    image = make(two_boxes()).render("top")["rgb"][0].astype(int)
    red, green, ground = image[ROW, LEFT], image[ROW, RIGHT], image[2, 2]
    assert red[0] > 120 > 60 > max(red[1], red[2])
    assert green[1] > 120 > 60 > max(green[0], green[2])
    assert np.ptp(ground) < 25


def test_up_in_the_image_is_the_cameras_up(make):
    """A box moved along +y moves up; the camera's roll turns the image."""
    engine = make(two_boxes())
    engine.set_body_state([[[-0.3, 0.35, 0.1, 0.0, 0.0, 0.0, 1.0]]], bodies=[0])
    ids = engine.render("top", channels=("segmentation",))["segmentation"][0]
    rows, columns = np.nonzero(ids == 1)
    assert rows.mean() < ROW - 5
    assert columns.mean() < 32
    images = engine.render("top", channels=("rgb", "depth"))
    assert images["rgb"][0, round(rows.mean()), round(columns.mean())].argmax() == 0
    assert images["depth"][0, round(rows.mean()), round(columns.mean())] == pytest.approx(1.8, abs=2e-4)
    half_turn = P.multiply(np.array(_looking_down()), np.array([0.0, 0.0, 1.0, 0.0]))
    engine.set_camera_pose("top", [[0.0, 0.0, 2.0, *half_turn]])
    rows, columns = np.nonzero(engine.render("top", channels=("segmentation",))["segmentation"][0] == 1)
    assert rows.mean() > ROW + 5
    assert columns.mean() > 32


def test_depth_is_along_the_optical_axis(make):
    """The ground is 2 m away everywhere, the boxes' tops 1.8 m."""
    depth = make(two_boxes()).render("top", channels=("depth",))["depth"][0]
    assert np.allclose(depth[[0, 0, -1, -1], [0, -1, 0, -1]], 2.0, atol=2e-4)
    assert np.allclose(depth[ROW, [LEFT, RIGHT]], 1.8, atol=2e-4)


def test_near_and_far_are_kept(make):
    """Beyond far there is nothing: inf and 0; what is nearer than near is not seen."""
    world = two_boxes(near=0.5, far=1.9)
    engine = make(world)
    images = engine.render("top", channels=("depth", "segmentation"))
    assert np.isinf(images["depth"][0, 0, 0])
    assert images["segmentation"][0, 0, 0] == 0
    assert images["depth"][0, ROW, LEFT] == pytest.approx(1.8, abs=2e-4)
    engine.set_camera_pose("top", [[-0.3, 0.0, 0.6, *_looking_down()]])
    assert np.isinf(engine.render("top", channels=("depth",))["depth"][0, ROW, 32]) or (
        engine.render("top", channels=("depth",))["depth"][0, ROW, 32] >= 0.5
    )


def test_segmentation_names_entities(make):
    """Ids of `Index.segmentation_id`; the ground is 0."""
    engine = make(two_boxes())
    ids = engine.render("top", channels=("segmentation",))["segmentation"][0]
    assert ids[ROW, LEFT] == engine.index.segmentation_id("red")
    assert ids[ROW, RIGHT] == engine.index.segmentation_id("green")
    assert ids[2, 2] == 0
    assert set(np.unique(ids)) == {0, 1, 2}


def test_the_field_of_view_is_vertical(make):
    """The top of a box of 0.2 m at 1.8 m covers 0.2 / (2 * 1.8 tan 20 deg) of the height."""
    ids = make(two_boxes()).render("top", 640, 480, channels=("segmentation",))["segmentation"][0]
    rows = np.flatnonzero((ids == 1).any(axis=1))
    assert np.ptp(rows) + 1 == pytest.approx(480 * 0.2 / (2 * 1.8 * np.tan(np.radians(20))), abs=2)


def test_envs_have_their_own_poses_and_colours(make):
    """One camera, three envs: a moved box, a painted box, nothing changed."""
    engine = make(two_boxes(), 3)
    engine.set_body_state([[[0.3, 5.0, 0.1, 0.0, 0.0, 0.0, 1.0]]], env_ids=[0], bodies=[1])
    engine.set_parameters("geom.color", [[[0.0, 0.0, 1.0, 1.0]]], [1], [2])
    images = engine.render("top", channels=("rgb", "segmentation"))
    assert images["segmentation"][:, ROW, RIGHT].tolist() == [0, 2, 2]
    assert images["rgb"][1, ROW, RIGHT].argmax() == 2
    assert images["rgb"][2, ROW, RIGHT].argmax() == 1


def test_neutral_grey_is_grey(make):
    """The colour MuJoCo takes for 'not set' is a colour like others."""
    world = two_boxes()
    grey = replace(world.geoms[1], color=(0.5, 0.5, 0.5, 1.0))
    image = make(replace(world, geoms=(world.geoms[0], grey, world.geoms[2]))).render("top")["rgb"][0].astype(int)
    assert np.ptp(image[ROW, LEFT]) < 10
    assert 60 < image[ROW, LEFT].mean() < 230


def test_invisible_geoms_are_not_drawn(make):
    """Collision-only ones in no channel, visual-only ones in all."""
    world = two_boxes()
    geoms = (world.geoms[0], replace(world.geoms[1], visible=False), replace(world.geoms[2], collides=False))
    images = make(replace(world, geoms=geoms)).render("top", channels=("rgb", "depth", "segmentation"))
    assert images["segmentation"][0, ROW, LEFT] == 0
    assert images["depth"][0, ROW, LEFT] == pytest.approx(2.0, abs=2e-4)
    assert images["segmentation"][0, ROW, RIGHT] == 2


def test_lights_and_shadows(make):
    """A world's own lights change the picture; shadows darken the ground beside a box."""
    base = two_boxes()
    lamp = Light("lamp", (1.0, 0.0, -0.5), color=(1.0, 1.0, 1.0))
    plain = make(base).render("top")["rgb"]
    lit, shaded = (
        make(replace(base, lights=(lamp,)), shadows=s).render("top")["rgb"][0].astype(int) for s in (False, True)
    )
    assert not np.array_equal(plain[0], lit)
    assert (lit[ROW, 26:31].mean(axis=-1) - shaded[ROW, 26:31].mean(axis=-1)).max() > 20


@pytest.mark.parametrize("middle", [0.0, 30.0])
@pytest.mark.parametrize("flat", [True, False])
def test_shadows_are_beside_what_casts_them_and_nowhere_else(make, flat: bool, middle: float):
    """On a plane and on wide uneven ground, in its middle and far from it; ground is not dotted with its own shadow."""
    rows = np.add.outer(np.cos(np.linspace(0, 60, 121)), np.zeros(121)) * 0.02
    field = HeightField("waves", rows, (80.0, 80.0))
    ground = Geom("ground", -1, Plane(60.0) if flat else HeightFieldShape("waves"), color=(0.5, 0.5, 0.5, 1.0))
    body = Body("box", BodyKind.STATIC, position=(middle, 0.0, 0.3))
    eye = Camera("eye", -1, (middle, 0.0, 12.0), _looking_down(), 60.0, 300, 300)
    world = World(
        "box",
        bodies=(body,),
        geoms=(ground, Geom("box", 0, Box((0.3, 0.3, 0.3)))),
        entities=(Entity("box", EntityKind.OBJECT, 0, 1, 0, 0),),
        heightfields=() if flat else (field,),
        lights=(Light("lamp", (-0.4, -0.3, -1.0), intensity=0.7),),
        cameras=(eye,),
    )
    lit, shaded = (make(world, shadows=s).render("eye")["rgb"][0].astype(int) for s in (False, True))
    v, u = np.nonzero(np.abs(lit - shaded).max(axis=2) > 8)
    away = np.hypot(u - 149.5, v - 149.5) * 24 * np.tan(np.pi / 6) / 300
    assert len(away) > 20
    assert away.max() < 1.0


def test_the_same_view_is_the_same_picture(make):
    """Twice, and after drawing something else."""
    engine = make(two_boxes(), 2)
    first = engine.render("top")["rgb"]
    engine.render("default", 128, 128, channels=("rgb", "segmentation"))
    assert np.array_equal(engine.render("top")["rgb"], first)
    assert np.array_equal(first[0], first[1])


def test_engines_draw_side_by_side_and_after_each_other(make):
    """One context serves them all; destroying one leaves the others."""
    one, two = (
        make(two_boxes()),
        make(
            replace(
                two_boxes(),
                bodies=two_boxes().bodies[:1],
                geoms=two_boxes().geoms[:2],
                entities=two_boxes().entities[:1],
            )
        ),
    )
    first = one.render("top")["rgb"]
    second = two.render("top", channels=("segmentation",))["segmentation"]
    assert set(np.unique(second)) == {0, 1}
    two.destroy()
    assert np.array_equal(one.render("top")["rgb"], first)


def test_drawing_from_several_threads(make):
    """Each thread gets the image it asked for."""
    engines = [make(two_boxes(), 2) for _ in range(2)]
    wanted = engines[0].render("top")["rgb"]
    failures: list[object] = []

    def draw(engine) -> None:
        for _ in range(10):
            try:
                if not np.array_equal(engine.render("top")["rgb"], wanted):
                    failures.append("another image")
            except Exception as error:  # noqa: BLE001
                failures.append(error)

    threads = [threading.Thread(target=draw, args=(engine,)) for engine in engines for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures


def test_drawing_changes_no_trajectory(worlds, make, shake):
    """Images are looks."""
    seen, unseen = make(worlds.scene(), 2), make(worlds.scene(), 2)
    seen.render("default", 64, 64, channels=("rgb", "depth", "segmentation"))
    shake(seen, 5)
    shake(unseen, 5)
    seen.render("default", 64, 64)
    assert all(np.array_equal(a, b) for a, b in zip(shake(seen), shake(unseen), strict=True))


def test_the_renderer_has_a_name(make):
    """Backend and driver."""
    assert make(two_boxes()).renderer_name().split(":")[0] in ("egl", "osmesa")


def test_another_backend_in_one_process_is_refused(make):
    """OpenGL is bound once; the error says which one is in use."""
    used = make(two_boxes()).renderer_name().split(":")[0]
    other = {"egl": "osmesa", "osmesa": "egl"}[used]
    with pytest.raises(EngineError, match=f"this process draws with {used}"):
        make(two_boxes(), gl=other).render("top")


def test_antialiasing_costs_too_much_without_a_graphics_card(make):
    """By default a software renderer draws one sample per pixel, a graphics card four; a number is what it says."""
    automatic, none, four = (make(two_boxes(), **options) for options in ({}, {"antialiasing": 0}, {"antialiasing": 4}))
    engines = {"auto": automatic, "none": none, "four": four}
    pictures = {name: engine.render("top")["rgb"] for name, engine in engines.items()}
    assert not np.array_equal(pictures["none"], pictures["four"])
    software = "in software" in automatic.renderer_name()
    assert np.array_equal(pictures["auto"], pictures["none" if software else "four"])
    assert none.renderer_name().endswith("no antialiasing")
    assert four.renderer_name().endswith("4 samples per pixel")
    assert automatic.options.samples(in_software=True) == 0
    assert automatic.options.samples(in_software=False) == 4
