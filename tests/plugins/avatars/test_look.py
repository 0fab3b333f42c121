"""The look `body`: closed surfaces about the bones, seen on every engine; what touches things is as without it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import trimesh

import anysim
from anysim.api import load
from anysim.compile.world import compile_world
from anysim.engine.capability import Capability
from anysim.engine.factory import runnable
from anysim.model.shapes import Capsule, MeshShape
from anysim.model.world import World
from anysim_avatars import look
from anysim_avatars.bodies import BONES, proportions, segments

CAMERA = {"from": [3.0, 0.0, 1.2], "look_at": [0.0, 0.0, 0.9], "size": [96, 96], "channels": ["rgb", "segmentation"]}


def described(shown: str, engine: str = "null") -> dict[str, Any]:
    people = {"ann": {"kind": "avatar", "seed": 3, "look": shown}}
    world = {"families": people, "cameras": {"front": CAMERA}}
    return {"engine": engine, "world": world, "task": {"observations": {"policy": ["last_action"]}}}


def world(shown: str) -> World:
    return compile_world(load(described(shown)).spec.world)


def test_what_touches_things_is_the_same_and_is_not_seen() -> None:
    capsules, body = world("capsules"), world("body")
    assert capsules.bodies == body.bodies
    solid, skin = ([g for g in w.geoms if g.collides and g.body >= 0] for w in (capsules, body))
    assert [replace(g, visible=True) for g in skin] == solid
    assert not any(g.visible for g in skin)
    assert all(isinstance(g.shape, Capsule) and g.visible for g in capsules.geoms if g.body >= 0)
    assert {g.body for g in body.geoms if g.visible} == {-1, *range(len(BONES))}


def test_surfaces_are_closed_and_lie_about_the_bones() -> None:
    """Their volume is that of a body of 70 kg or so, and every one is within a few centimetres of its capsule."""
    rng = np.random.default_rng(7)
    for height in (1.55, 1.75, 1.9):
        one = proportions(height, rng)
        ends, radii = segments(one)
        volume = 0.0
        meshes, geoms = look.shapes(one)
        found = {mesh.name: mesh for mesh in meshes}
        for geom in geoms:
            if not isinstance(geom.shape, MeshShape):
                continue
            mesh = found[geom.shape.mesh]
            solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
            assert solid.is_watertight, geom.name
            assert solid.volume > 0, geom.name
            volume += float(solid.volume)
            a, b = ends[:, geom.body]
            along = np.clip((mesh.vertices - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
            away = np.linalg.norm(mesh.vertices - a - along[:, None] * (b - a), axis=1)
            assert away.max() < radii[geom.body] + 0.12 * height / 1.75, geom.name
        assert 45e-3 < volume < 100e-3


def test_the_seed_makes_each_its_own() -> None:
    first, second = (look.shapes(proportions(1.7, np.random.default_rng(seed)))[0] for seed in (1, 2))
    again = look.shapes(proportions(1.7, np.random.default_rng(1)))[0]
    assert [mesh.hash for mesh in first] == [mesh.hash for mesh in again]
    other = {a.name for a, b in zip(first, second, strict=True) if a.hash != b.hash}
    assert {mesh.name for mesh in first} - other == {"head_skin", "hair_skin"}  # as large as the body is tall


@pytest.mark.parametrize("engine", runnable(Capability.RENDER_SEGMENTATION))
def test_a_body_is_seen_where_the_capsules_are(engine: str) -> None:
    seen = []
    for shown in ("capsules", "body"):
        with anysim.make(described(shown, engine)) as env:
            env.reset(seed=0)
            seen.append(env.engine.render("front", channels=("segmentation",))["segmentation"][0] > 0)
    assert seen[1].sum() > 300
    both = (seen[0] & seen[1]).sum() / (seen[0] | seen[1]).sum()
    assert both > 0.6
