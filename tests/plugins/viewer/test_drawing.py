"""The scene in the page: batches, what is not there, contacts, matter and textures, as a client is told them."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from anysim.engine.state import ContactPoints
from anysim.model.shapes import Box
from anysim.model.world import Texture, World
from anysim.testing.sketch import Sketch
from anysim_viewer.client import connected
from anysim_viewer.drawing import BATCH, LONGEST, Drawing
from anysim_viewer.gate import Access
from anysim_viewer.moment import Matter, Moment
from anysim_viewer.page import Page
from tests.plugins.viewer.person import Person


@contextmanager
def drawn(world: World) -> Iterator[tuple[Drawing, Person]]:
    page = Page(Access(token="token"), "drawing")
    try:
        with connected(page.url) as client:
            yield Drawing(page, world), Person(client)
    finally:
        page.close()


def boxes(count: int, **more: Any) -> World:
    s = Sketch("boxes")
    for k in range(count):
        s.free(f"box{k}", Box((0.1, 0.1, 0.1)), (float(k), 0.0, 1.0))
    return replace(s.world(), **more)


def moment(world: World, **more: Any) -> Moment:
    there = np.ones(len(world.entities), dtype=bool)
    return Moment(1, 0.1, np.array(world.initial_body_pose), more.pop("present", there), **more)


def test_what_looks_alike_is_a_batch_and_what_is_not_there_is_not_seen() -> None:
    world = boxes(BATCH)
    present = np.arange(BATCH) != 2
    with drawn(world) as (drawing, person):
        drawing.show(moment(world, present=present))
        person.until(
            lambda: any(
                "batched_scales" in one and np.sum(one["batched_scales"]) == BATCH - 1 for one in person.nodes.values()
            )
        )
        (batch,) = [one for name, one in person.nodes.items() if name.startswith("/batches/")]
        np.testing.assert_array_equal(batch["batched_scales"], present.astype(np.float32))
        np.testing.assert_allclose(batch["batched_positions"].reshape(-1, 3)[:, 0], np.arange(BATCH))
        assert not [name for name in person.nodes if name.startswith("/bodies/0")]
        drawing.look(replaced(drawing, 1))
        drawing.show(moment(world))
        person.until(lambda: any(name.startswith("/bodies/1-") for name in person.nodes))  # it looks otherwise now
        assert next(one for name, one in person.nodes.items() if name.startswith("/bodies/1-") and name.endswith("/0"))[
            "color"
        ] == [255, 0, 0]


def replaced(drawing: Drawing, body: int) -> Any:
    """The looks of a World with one body in red."""
    from anysim_viewer.solids import built_looks

    looks = built_looks(drawing.world)
    looks.color[[g for g, geom in enumerate(drawing.world.geoms) if geom.body == body]] = [1.0, 0.0, 0.0, 1.0]
    return looks


def test_forces_are_arrows_and_matter_is_a_cloud_or_a_surface() -> None:
    world = boxes(1)
    one, none = np.zeros((1, 3)), np.zeros((0, 3), dtype=np.int32)
    contacts = ContactPoints(
        np.array([0]), np.array([0]), np.array([-1]), one, one, np.array([[0.0, 0.0, 10.0]]), np.zeros(1)
    )
    points = np.arange(12.0, dtype=np.float32).reshape(4, 3)
    matter = {
        "water": Matter(points, 0.01, none, np.array([0.0, 0.0, 1.0])),
        "cloth": Matter(points, 0.01, np.array([[0, 1, 2]]), np.array([1.0, 1.0, 0.0])),
    }
    with drawn(world) as (drawing, person):
        drawing.shown["contacts"] = True
        drawing.show(moment(world, contacts=contacts, matter=matter))
        person.until(lambda: {"/contacts/forces", "/matter/water", "/matter/cloth"} <= person.nodes.keys())
        np.testing.assert_allclose(person.nodes["/contacts/forces"]["points"].reshape(2, 3)[1], [0.0, 0.0, 0.1])
        np.testing.assert_array_equal(person.nodes["/matter/water"]["points"].reshape(-1, 3), points)
        assert len(person.nodes["/matter/cloth"]["faces"]) == 3
        strong = contacts._replace(force=np.array([[0.0, 0.0, 1e6]]))
        drawing.show(moment(world, contacts=strong, matter={"cloth": matter["cloth"]}))
        person.until(lambda: "/matter/water" not in person.nodes)
        person.until(lambda: person.nodes["/contacts/forces"]["points"].reshape(2, 3)[1, 2] == pytest.approx(LONGEST))
        drawing.shown["contacts"] = False
        drawing.show(moment(world, contacts=strong))
        person.until(lambda: not {"/contacts/forces", "/contacts/points", "/matter/cloth"} & person.nodes.keys())


def test_textures_are_sent_with_their_pixels() -> None:
    pixels = np.full((4, 4, 3), 200, dtype=np.uint8)
    plain = boxes(1)
    geoms = tuple(replace(geom, texture="wood") for geom in plain.geoms)
    world = replace(plain, textures=(Texture("wood", pixels),), geoms=geoms)
    with drawn(world) as (drawing, person):
        drawing.show(moment(world))
        person.until(lambda: any("glb_data" in one for one in person.nodes.values()))
        assert any(b"glTF" in bytes(one["glb_data"]) for one in person.nodes.values() if "glb_data" in one)


def test_nothing_is_sent_where_nothing_has_moved() -> None:
    world = boxes(2)
    with drawn(world) as (drawing, person):
        drawing.show(moment(world))
        person.until(
            lambda: any("position" in one for name, one in person.nodes.items() if name.startswith("/bodies/1"))
        )
        while person.client.receive(0.5):
            pass
        before = person.client.messages
        drawing.show(moment(world))
        assert not person.client.receive(0.5)
        assert person.client.messages == before


def test_what_comes_is_drawn_where_it_went_meanwhile() -> None:
    world = boxes(1)
    away = np.zeros(len(world.entities), dtype=bool)
    moved = np.array(world.initial_body_pose)
    moved[0, :3] = [0.5, 0.5, 0.5]
    with drawn(world) as (drawing, person):
        drawing.show(moment(world))
        drawing.show(replace(moment(world, present=away), body_pose=moved))
        person.until(
            lambda: any(one.get("visible") is False for name, one in person.nodes.items() if "/bodies/0" in name)
        )
        drawing.show(replace(moment(world), body_pose=moved))
        node = next(one for name, one in person.nodes.items() if name.startswith("/bodies/0-") and name.count("/") == 2)
        person.until(lambda: node["visible"] and np.allclose(node["position"], [0.5, 0.5, 0.5]))
