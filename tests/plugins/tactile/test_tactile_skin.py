"""Taxels against theory, without any engine: foundations, edges, curved skins, and what cannot be carried."""

import numpy as np
import pytest

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.world import Body, BodyKind, Box, Cylinder, Entity, EntityKind, Geom, Shape, Sphere, World
from anysim_sensors.scene import SceneGeometry
from anysim_tactile.lights import LIGHTS, fitted
from anysim_tactile.skin import Skin
from anysim_tactile.surfaces import Surface, cylindrical, flat, scattered, spherical
from tests.plugins.sensors.worlds import HERE

K = 5e7
THICK = 0.004


def gaps(surface: Surface, shape: Shape, position: tuple[float, float, float], source: str = "rays") -> Array:
    """(1, T) [m] to one shape."""
    body = Body("thing", BodyKind.STATIC, -1, position)
    world = World(
        "one",
        bodies=(body,),
        geoms=(Geom("thing", 0, shape),),
        entities=(Entity("thing", EntityKind.OBJECT, 0, 1, 0, 0),),
    )
    scene = SceneGeometry(world)
    posed = scene.posed(world.initial_body_pose[None])
    if source == "distance":
        return scene.distances(posed, HERE[None], surface.points).distance
    back = surface.points - THICK * surface.normals
    return scene.rays(posed, HERE[None], back, surface.normals, reach=2 * THICK).distance - THICK


def wrench(force: tuple[float, float, float], at: tuple[float, float, float]) -> Array:
    return np.concatenate([force, np.cross(at, force)])[None]


def test_a_ball_on_a_pad_is_winklers() -> None:
    """A paraboloid of pressure, k (s - r^2/2R), and F = k pi R s^2, as far as a ball is one: s/R is 6 %."""
    pad, radius, force = flat((0.016, 0.016), (40, 40)), 0.006, 0.1 * 9.81
    for sunk in (0.0, 1e-5, 3e-4):  # what an engine makes of it does not count
        gap = gaps(pad, Sphere(radius), (0.0011, -0.0007, radius - sunk))
        load = wrench((0.0, 0.0, -force), (0.0011, -0.0007, 0.0))
        carried = Skin(pad, K).carry(gap, load, load)
        deep = carried.deep[0]
        s = np.sqrt(force / (K * np.pi * radius))
        r = np.hypot(pad.points[:, 0] - 0.0011, pad.points[:, 1] + 0.0007)
        theory = np.maximum(0.0, s - r**2 / (2 * radius))
        assert deep.max() == pytest.approx(s, rel=0.03)
        assert np.sqrt(((deep - theory) ** 2).mean()) < 0.015 * s
        assert carried.force[0].sum(axis=0) == pytest.approx([0, 0, -force], abs=1e-12)


def test_rays_are_exact_at_edges_where_distances_are_not() -> None:
    """A box and a standing cylinder, 0.8 mm deep: a distance inside of an edge is that to the side."""
    pad = flat((0.016, 0.016), (20, 20))
    for shape, inside in (
        (Box((0.004, 0.0035, 0.005)), (np.abs(pad.points[:, 0]) < 0.004) & (np.abs(pad.points[:, 1]) < 0.0035)),
        (Cylinder(0.005, 0.005), np.hypot(pad.points[:, 0], pad.points[:, 1]) < 0.005),
    ):
        depth = {name: np.maximum(0.0, -gaps(pad, shape, (0, 0, 0.0042), name)[0]) for name in ("rays", "distance")}
        assert np.abs(depth["rays"] - 0.0008 * inside).max() < 1e-12
        assert np.abs(depth["distance"] - 0.0008 * inside).max() >= 0.4e-3 - 1e-9


@pytest.mark.parametrize("grid", [(15, 15), (24, 20)])
def test_a_plate_on_a_curved_skin(grid: tuple[int, int]) -> None:
    """By rays as deep along each normal as the plate is there; by distances never deeper, and shallower to the side."""
    radius, deep = 0.008, 0.0008
    for cap in (spherical(radius, (0.9, 0.9), grid), cylindrical(radius, 0.9, 0.01, grid)):
        assert cap.area.sum() == pytest.approx(_area(cap, radius), rel=0.01)
        assert P.dot(cap.up, P.cross(cap.normals, cap.right)) == pytest.approx(np.ones(len(cap.points)))
        along = cap.normals[:, 2]
        plate, bottom = Box((0.1, 0.1, 0.002)), radius - deep
        exact = np.maximum(0.0, radius - bottom / along)
        depth = np.maximum(0.0, -gaps(cap, plate, (0, 0, bottom + 0.002))[0])
        assert np.abs(depth - exact)[exact < THICK].max() < 1e-12
        near = np.maximum(0.0, -gaps(cap, plate, (0, 0, bottom + 0.002), "distance")[0])
        assert near == pytest.approx(np.maximum(0.0, radius * along - bottom), abs=1e-12)
        load = wrench((0.1, 0.0, -2.0), (0.0, 0.0, radius))
        carried = Skin(cap, K).carry(-exact[None], wrench((0.0, 0.0, -2.0), (0.0, 0.0, radius)), load)
        assert carried.total == pytest.approx(load, abs=1e-12)
        assert (P.dot(carried.force[0], cap.normals) <= 1e-15).all()


def _area(cap: Surface, radius: float) -> float:
    if np.ptp(cap.normals[:, 1]) < 1e-12:
        return radius * 1.8 * 0.01
    # the solid angle of a pyramid whose sides are 0.9 from its middle
    return 4 * radius**2 * np.arcsin(np.sin(0.9) ** 2)


def test_a_force_beside_its_taxels_is_not_all_carried() -> None:
    """No taxel pulls: the force comes out, the moment as far as pushing goes."""
    pad = flat((0.01, 0.01), (10, 10))
    load = wrench((0.0, 0.0, -2.0), (0.02, 0.0, 0.0))
    carried = Skin(pad, K).carry(np.zeros((1, 100)), load, load)
    assert carried.total[0, :3] == pytest.approx(load[0, :3], abs=1e-12)
    assert carried.total[0, 4] < load[0, 4] * 0.6
    assert (carried.force[..., 2] <= 1e-15).all()


def test_a_tilted_load_lifts_taxels_off() -> None:
    pad = flat((0.02, 0.02), (20, 20))
    middle = wrench((0.0, 0.0, -5.0), (0.0, 0.0, 0.0))
    aside = wrench((0.0, 0.0, -5.0), (0.006, -0.002, 0.0))
    carried = Skin(pad, K).carry(np.zeros((2, 400)), *[np.concatenate([middle, aside])] * 2)
    assert (carried.deep[0] > 0).all()
    assert 100 < (carried.deep[1] > 0).sum() < 320
    assert carried.total == pytest.approx(np.concatenate([middle, aside]), abs=1e-12)
    alone = Skin(pad, K).carry(np.zeros((1, 400)), aside, aside)
    assert alone.force.tobytes() == carried.force[1:].tobytes()


def test_random_loads_on_few_taxels() -> None:
    """Taxels with normals all about, most of which touch nothing at first: no force is lost, and none pulls."""
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-0.02, 0.02, (30, 2)), rng.uniform(-0.002, 0.002, 30)])
    normals = np.column_stack([rng.normal(0, 0.2, (30, 2)), np.ones(30)])
    at = np.column_stack([rng.uniform(-0.01, 0.01, (200, 2)), np.zeros(200)])
    push = np.column_stack([np.zeros((200, 2)), -rng.uniform(0.01, 20, 200)])
    load, gap = np.concatenate([push, np.cross(at, push)], axis=1), rng.uniform(0, 0.003, (200, 30))
    for out, whole in ((normals, 0.9), (np.array([[0.0, 0.0, 1.0]]), 1.0)):
        surface = scattered(points, out, 1e-4)
        carried = Skin(surface, K).carry(gap, load, load)
        assert np.abs(carried.total - load)[:, :3].max() < 1e-9
        assert P.dot(carried.force, surface.normals[None]).max() < 1e-12
        exact = np.abs(carried.total - load)[:, 3:].max(axis=1) < 1e-9
        assert exact.mean() >= whole


def test_the_fit_of_a_light_finds_it() -> None:
    """Photographs that are drawn with a light, and the light that is fitted to them."""
    truth, ball, (rows, columns) = LIGHTS["gelsight"], 40.0, (120, 160)
    still = truth.undisturbed((rows, columns))
    v, u = np.mgrid[:rows, :columns]
    centres, photographs = np.array([[50.0, 60.0], [100.0, 40.0]]), []
    for x, y in centres:
        a, b = (u - x) / ball, (v - y) / ball
        up = np.sqrt(np.maximum(0.0, 1 - a * a - b * b)) - 1
        change = np.stack([a, b, up], axis=-1) @ np.array(truth.matrix)
        photographs.append(still + np.where((a * a + b * b < 0.5)[..., None], change, 0.0))
    found = fitted(np.array(photographs), still, centres, np.array([25.0, 20.0]), ball, "drawn")
    assert np.array(found.matrix) == pytest.approx(np.array(truth.matrix), abs=1e-6)
    assert np.array(found.background) == pytest.approx(np.array(truth.background), abs=1e-6)
    assert found.calibrated


def test_guesses_are_named_so() -> None:
    for name, light in LIGHTS.items():
        assert light.source
        assert light.calibrated != name.startswith("uncalibrated")
