"""Contact sensors, contact points, rays and cameras, on scenes with known answers."""

import numpy as np

from anysim.conventions import WORLD
from anysim.engine.capability import Capability as C
from anysim.math import pose as P
from anysim.model.world import Box, ContactSensor, Sphere
from anysim.testing import tolerances, worlds
from anysim.testing.compare import assert_close, assert_ratio, assert_same, play, read, tape
from anysim.testing.fixtures import needs
from anysim.testing.sketch import Sketch

G = 9.81


def _stack():
    """A box of 2 kg on the ground, a ball of 0.5 kg on the box; sensors for all, the ball, the ground, and both."""
    s = Sketch("stack")
    s.ground()
    box = s.free("box", Box((0.2, 0.2, 0.1)), (0.0, 0.0, 0.1), 2.0)
    ball = s.free("ball", Sphere(0.1), (0.0, 0.0, 0.3), 0.5)
    s.sensors += [
        ContactSensor("all", (box,)),
        ContactSensor("ball", (box,), (ball,)),
        ContactSensor("ground", (box,), (WORLD,)),
        ContactSensor("both", (box, ball)),
    ]
    return s.world()


@needs(C.DYNAMICS)
def test_contact_sensors_weigh(build):
    """At rest a sensor gives the net contact force [N] on its bodies, world axes; `against` picks some contacts."""
    engine = build(_stack(), 2)
    engine.step(1000)
    force = engine.get_state().contact_force
    assert force.shape == (2, 4, 3)
    for sensor, wanted in enumerate((2.0 * G, -0.5 * G, 2.5 * G)):
        assert_ratio(force[0, sensor, 2], wanted, tolerances.WEIGHT, engine.world.contact_sensors[sensor].name)
    assert_close(force[:, :3, :2], 0.0, tolerances.WEIGHT * G, "horizontal force")
    assert_ratio(force[0, 3, 2], 2.5 * G, tolerances.WEIGHT, "forces between the sensor's own bodies cancel")


def test_contact_sensors_read_zero_in_the_air(build):
    """Without contact a sensor gives exactly zero."""
    engine = build(worlds.resting(Sphere(0.1), 0.1, gap=1.0), 2)
    engine.step(3)
    assert not engine.get_state().contact_force.any()


@needs(C.DYNAMICS, C.CONTACT_POINTS)
def test_contact_points(build):
    """Contact points: env, bodies (-1 for the world), unit normal from a to b, force on b, depth."""
    engine = build(_stack(), 2)
    engine.step(1000)
    contacts = engine.contacts([1])
    assert (contacts.env == 1).all()
    pairs = {tuple(sorted(pair)) for pair in zip(contacts.body_a.tolist(), contacts.body_b.tolist(), strict=True)}
    assert pairs == {(-1, 0), (0, 1)}
    assert_close(np.linalg.norm(contacts.normal, axis=1), 1.0, tolerances.READ_BACK, "length of normals")
    assert (np.abs(contacts.depth) < tolerances.REST_HEIGHT).all()
    on_box = np.where((contacts.body_b == 0)[:, None], contacts.force, 0.0) - np.where(
        (contacts.body_a == 0)[:, None], contacts.force, 0.0
    )
    assert_ratio(on_box[:, 2].sum(), 2.0 * G, tolerances.WEIGHT, "sum of the forces on the box")
    place = engine.get_state().body_pose[1, :, :3]
    for a, b, normal, point in zip(contacts.body_a, contacts.body_b, contacts.normal, contacts.position, strict=True):
        below = np.zeros(3) if a == WORLD else place[a]
        above = np.zeros(3) if b == WORLD else place[b]
        assert normal[2] * (above[2] - below[2]) > 0, "a normal points from a to b"
        assert min(abs(point[2]), abs(point[2] - 0.2)) < 2 * tolerances.REST_HEIGHT, "where they touch"


# ---------------------------------------------------------------------- rays


@needs(C.RAYCAST)
def test_rays_hit_at_their_distance(build):
    """Distances are in metres whatever the direction's length; the entity is its segmentation id, -1 for a miss."""
    engine = build(worlds.wall(cameras=False), 2)
    ids = [engine.index.segmentation_id(name) for name in ("wall", "red", "green")]
    origins = np.zeros((2, 4, 3))
    directions = np.array([[3.0, 0.0, 0.0], [1.0, 0.3, 0.0], [0.1, -0.03, 0.0], [-1.0, 0.0, 0.0]])
    hits = engine.raycast(origins, np.broadcast_to(directions, (2, 4, 3)))
    slant = np.hypot(1.0, 0.3)
    assert hits.distance.shape == (2, 4)
    assert np.isinf(hits.distance[:, 3]).all()
    assert_close(hits.distance[:, :3], np.array([2.0, slant, slant]), tolerances.RAY, "distances")
    assert hits.entity.tolist() == [[*ids, -1]] * 2


@needs(C.RAYCAST)
def test_rays_hit_the_ground_and_what_moved(build):
    """The ground is entity 0; a body is hit where it was just put, in its own env alone."""
    engine = build(worlds.scene(), 2)
    box = engine.index.body("box")
    engine.set_body_state(pose=[5.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], env_ids=[1], bodies=[box])
    hits = engine.raycast([[[5.0, 0.0, 3.0]]] * 2, [[[0.0, 0.0, -1.0]]] * 2)
    assert_close(hits.distance[:, 0], np.array([3.0, 1.9]), tolerances.RAY, "distances")
    assert hits.entity[:, 0].tolist() == [0, engine.index.segmentation_id("box")]
    one = engine.raycast([[[5.0, 0.0, 3.0]]], [[[0.0, 0.0, -1.0]]], env_ids=[1])
    assert_close(one.distance, 1.9, tolerances.RAY, "one env by its id")


@needs(C.RAYCAST)
def test_rays_change_nothing(build):
    """Casting rays does not change the run."""
    world = worlds.scene()
    engine, clean = build(world), build(world)
    for target in tape(world, [0], 20):
        for e in (engine, clean):
            e.set_control(position=target)
            e.step(2)
        engine.raycast([[[0.8, 0.0, 2.0]]], [[[0.0, 0.0, -1.0]]])
    assert_same(read(engine), read(clean), "with rays against without")


# ---------------------------------------------------------------------- cameras
# In the wall's images a pixel at (row 24, column u) looks at y / x = (32 - u) / 41.6.

LEFT, RIGHT, ROW = 19, 44, 24


def test_pictures_have_their_shapes(build):
    """rgb (E, H, W, 3) uint8, depth (E, H, W) float32, segmentation (E, H, W) int32; sizes and envs as asked."""
    engine = build(worlds.wall(), 3)
    channels = ("rgb", "depth", "segmentation")
    images = engine.render("fixed", channels=channels)
    assert list(images) == list(channels)
    assert images["rgb"].shape == (3, 48, 64, 3)
    assert images["rgb"].dtype == np.uint8
    assert images["depth"].shape == images["segmentation"].shape == (3, 48, 64)
    assert images["depth"].dtype == np.float32
    assert images["segmentation"].dtype == np.int32
    small = engine.render("fixed", width=20, height=10, env_ids=[2], channels=("depth",))
    assert list(small) == ["depth"]
    assert small["depth"].shape == (1, 10, 20)


@needs(C.RENDER_RGB, C.RENDER_SEGMENTATION)
def test_two_engines_draw_in_turn(build):
    """What one engine draws does not depend on another one that draws in between."""
    engine, other = build(worlds.wall()), build(worlds.scene(cameras=True))
    channels = ("rgb", "segmentation")
    wanted = engine.render("fixed", channels=channels)
    for _ in range(2):
        other.render("front", channels=channels)
        assert_same(engine.render("fixed", channels=channels), wanted, "after another engine drew")


def test_depth_of_a_wall(build):
    """Depth is along the optical axis: a wall across the view has one depth, 2 m, from corner to corner."""
    depth = build(worlds.wall()).render("fixed", channels=("depth",))["depth"][0]
    for row, column in ((0, 0), (0, 63), (47, 0), (47, 63), (ROW, 32)):
        assert_ratio(depth[row, column], 2.0, tolerances.DEPTH, f"depth at {row}, {column}")
    assert_ratio(depth[ROW, LEFT], 1.0, tolerances.DEPTH, "depth of the left cube's face")


def test_segmentation_of_boxes(build):
    """Segmentation holds the entities' ids; the image's left is the camera's left."""
    engine = build(worlds.wall())
    ids = engine.render("fixed", channels=("segmentation",))["segmentation"][0]
    for name, column in (("red", LEFT), ("wall", 32), ("green", RIGHT)):
        assert ids[ROW, column] == engine.index.segmentation_id(name), f"column {column} should show {name}"
    assert ids[5, LEFT] == engine.index.segmentation_id("wall")


def test_nothing_to_see_is_far_and_zero(build):
    """Where nothing is, depth is inf and segmentation 0."""
    engine = build(worlds.wall())
    away = P.look_at(np.zeros(3), np.array([-1.0, 0.0, 0.0]))
    engine.set_camera_pose("fixed", np.concatenate([np.zeros(3), away]))
    images = engine.render("fixed", channels=("depth", "segmentation"))
    assert np.isinf(images["depth"]).all()
    assert not images["segmentation"].any()


def test_a_camera_rides_on_its_body(build):
    """A camera fixed to a link looks where the link turns: 0.29 rad to the left it faces the left cube."""
    engine = build(worlds.wall(), 2)
    engine.set_joint_state([[np.arctan2(0.3, 1.0)]], env_ids=[1])
    middle = engine.render("eye", channels=("segmentation",))["segmentation"][:, ROW, 32]
    assert middle.tolist() == [engine.index.segmentation_id("wall"), engine.index.segmentation_id("red")]


def test_cameras_are_placed_per_env(build):
    """`set_camera_pose` moves a camera in the envs named."""
    engine = build(worlds.wall(), 2)
    pose = engine.camera_poses("fixed")[0]
    pose[0] += 0.5
    engine.set_camera_pose("fixed", pose, env_ids=[1])
    depth = engine.render("fixed", channels=("depth",))["depth"][:, ROW, 32]
    assert_ratio(depth[0], 2.0, tolerances.DEPTH, "the camera that stayed")
    assert_ratio(depth[1], 1.5, tolerances.DEPTH, "the camera half a metre ahead")


def test_pictures_are_of_the_state_now(build):
    """An image shows what was written just before, without a step."""
    engine = build(worlds.scene(cameras=True))
    crop = engine.render("front", channels=("segmentation",))["segmentation"]
    engine.set_body_state(pose=[50.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0], bodies=[engine.index.body("box")])
    gone = engine.render("front", channels=("segmentation",))["segmentation"]
    box = engine.index.segmentation_id("box")
    assert (crop == box).any()
    assert not (gone == box).any()


def test_rendering_changes_nothing(build):
    """Rendering does not change the run, and the same state gives the same image."""
    world = worlds.scene(cameras=True)
    engine, clean = build(world), build(world)
    for _ in range(3):
        play(engine, tape(world, [0], 3))
        play(clean, tape(world, [0], 3))
        one, two = engine.render("front")["rgb"], engine.render("front")["rgb"]
        assert np.array_equal(one, two)
    assert_same(read(engine), read(clean), "with images against without")


@needs(C.RENDER_RGB)
def test_the_default_camera_shows_the_world(build):
    """`render()` without a name gives an overview in any world."""
    image = build(worlds.scene()).render(width=64, height=48)["rgb"]
    assert image.shape == (1, 48, 64, 3)
    assert image.std() > 1.0, "the overview is of one colour"
