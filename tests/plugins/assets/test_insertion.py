"""Pegs, holes, buttons and trays: what fits into what, with the clearance that was asked for."""

from typing import Any

import numpy as np
import pytest

from anysim.assets.load import import_asset
from anysim.assets.procedural import build
from anysim.geometry.bounds import EntityShape
from anysim.math import pose as P
from anysim.model.world import Box
from tests.plugins.assets.test_procedural import complaints, world_of

UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])


def free_radius(params: dict[str, Any], turns: int = 72) -> float:
    """How far from the axis the nearest surface of a block is, by its boxes' faces."""
    nearest = np.inf
    for geom in build("hole_block", params).geoms:
        assert isinstance(geom.shape, Box)
        half = np.array(geom.shape.half_size)
        for angle in np.linspace(0.0, 2 * np.pi, turns, endpoint=False):
            for radius in np.linspace(0.0, 0.03, 301):
                point = np.array([radius * np.cos(angle), radius * np.sin(angle), geom.position[2]])
                local = P.rotate_inverse(np.array(geom.quaternion), point - np.array(geom.position))
                if (np.abs(local) <= half).all():
                    nearest = min(nearest, radius)
                    break
    return float(nearest)


@pytest.mark.parametrize("section", ["square", "round"])
@pytest.mark.parametrize("clearance", [0.003, 0.001])
def test_a_hole_has_the_clearance_on_each_side(section: str, clearance: float) -> None:
    found = free_radius({"section": section, "clearance": clearance}, turns=24)
    assert found == pytest.approx(0.015 + clearance, abs=2e-4)


def test_a_peg_stands_on_its_tip() -> None:
    world = world_of({"procedural": "peg", "params": {"width": 0.02, "length": 0.08}})
    low, high = EntityShape(world, "it").bounds(np.concatenate([np.zeros(3), UPRIGHT]))
    assert np.allclose(high - low, [0.02, 0.02, 0.08])
    sites = {site.name: site.position for site in import_asset("procedural:peg").sites}
    assert sites == {"tip": (0.0, 0.0, -0.05), "head": (0.0, 0.0, 0.05)}


def test_a_ring_weighs_what_a_ring_weighs() -> None:
    model = build("hole_block", {"section": "round", "pieces": 48, "density": 1000.0})
    ring = np.pi * (0.05**2 - 0.018**2) * 0.05 * 1000.0
    assert model.bodies[0].inertial is not None
    assert model.bodies[0].inertial.mass == pytest.approx(ring, rel=5e-3)


def test_a_lying_peg_fits_into_a_hole_in_a_side() -> None:
    """Its axis is the hole's, its tip the hole's end, and no board of the block is nearer than the clearance."""
    peg, block = (
        build("peg", {"along": "x", "width": 0.04, "length": 0.2}),
        build("side_hole", {"width": 0.04, "clearance": 0.003, "depth": 0.08, "size": 0.16}),
    )
    tip, head = (next(site for site in peg.sites if site.name == name) for name in ("tip", "head"))
    hole, mouth = (next(site for site in block.sites if site.name == name) for name in ("hole", "mouth"))
    up = np.array([0.0, 0.0, 1.0])
    assert np.allclose(P.rotate(np.array(tip.quaternion), up), (1.0, 0.0, 0.0))
    assert np.allclose(np.subtract(head.position, tip.position), (0.2, 0.0, 0.0))
    assert np.allclose(P.rotate(np.array(mouth.quaternion), up), (-1.0, 0.0, 0.0))
    assert np.allclose(np.subtract(mouth.position, hole.position), (-0.08, 0.0, 0.0))
    for geom in block.geoms:
        assert isinstance(geom.shape, Box)
        gap = np.abs(np.subtract(geom.position, mouth.position))[1:] - np.array(geom.shape.half_size)[1:]
        assert gap.max() == pytest.approx(0.023)


def test_a_hook_pulls_with_its_inner_side() -> None:
    """What pulls is where the hook begins, and looks back along the handle; the handle's mass is its volume's."""
    model = build("hook", {"length": 0.26, "reach": 0.08, "width": 0.03, "density": 1000.0})
    grip, inner = (next(site for site in model.sites if site.name == name) for name in ("grip", "inner"))
    assert np.allclose(inner.position, (0.1, 0.055, 0.0))
    assert np.allclose(P.rotate(np.array(inner.quaternion), np.array([1.0, 0.0, 0.0])), (-1.0, 0.0, 0.0))
    assert grip.position[0] == pytest.approx(-0.1)
    assert model.bodies[0].inertial is not None
    assert model.bodies[0].inertial.mass == pytest.approx(1000 * 0.03 * 0.03 * (0.26 + 0.08))


def test_the_frame_of_a_t_is_its_centre_of_mass() -> None:
    model = build("tee", {})
    inertial = model.bodies[0].inertial
    assert inertial is not None
    assert np.allclose(inertial.com, 0.0, atol=1e-12)
    assert inertial.mass == pytest.approx(1140 * 0.04 * (0.2 * 0.05 + 0.15 * 0.05))


def test_a_button_is_pressed_down() -> None:
    [joint] = build("button", {"travel": 0.01}).joints
    assert (joint.axis, joint.lower, joint.upper) == ((0.0, 0.0, -1.0), 0.0, 0.01)


def test_a_tray_is_open_at_the_top() -> None:
    model = build("tray", {"size": [0.3, 0.2, 0.1], "wall": 0.01})
    volume = 0.3 * 0.2 * 0.1 - 0.28 * 0.18 * 0.09
    assert model.bodies[0].inertial is not None
    assert model.bodies[0].inertial.mass == pytest.approx(700 * volume)


def test_what_leaves_nothing_is_said_with_its_key() -> None:
    for name, params, key in (
        ("hole_block", {"size": 0.03}, "size"),
        ("side_hole", {"size": 0.04}, "size"),
        ("hook", {"length": 0.08}, "length"),
        ("tee", {"stem": [0.1, 0.3]}, "stem"),
        ("button", {"radius": 0.06}, "radius"),
        ("tray", {"wall": 0.2}, "size"),
    ):
        [text] = complaints(source={"procedural": name, "params": params})
        assert text.startswith(f"objects.it.source.params.{key}: ")
