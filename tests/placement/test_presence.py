"""Placement where envs differ in what is present, and in their origins."""

from dataclasses import replace

import numpy as np

from anysim.api import compile_world, load
from anysim.managers.standard import standard_managers
from anysim.model.world import Slot, World
from anysim.testing.kinematic import NullEngine
from anysim_schemas.layout import PlacementSpec
from anysim_schemas.run import RunSpec

BOXES = {"small": 0.02, "large": 0.1, "cup_0": 0.03, "cup_1": 0.03}


def varied() -> tuple[World, RunSpec]:
    """A table, a `thing` that is small or large, and a category `cup` of two, the second of which stands near it."""
    objects = {name: {"source": {"box": [size] * 3}} for name, size in BOXES.items()}
    table = {"table": {"source": {"box": [0.8, 0.8, 0.4]}, "fixed": True}}
    place = {"table": {"position": [0, 0, 0.2]}}
    loaded = load({"engine": "null", "world": {"objects": {**table, **objects}, "layout": place}})
    world = compile_world(loaded)
    number = {entity.name: k for k, entity in enumerate(world.entities)}
    slots = (
        Slot("thing", "thing", 0, (number["small"], number["large"])),
        Slot("cup_0", "cup", 0, (number["cup_0"],)), Slot("cup_1", "cup", 1, (number["cup_1"],)),
    )  # fmt: skip
    layout = {
        "table": loaded.spec.world.layout["table"],
        "thing": PlacementSpec.model_validate({"on": "table", "yaw": {"range": [-3.0, 3.0]}}),
        "cup": PlacementSpec.model_validate({"on": "table", "clearance": 0.01}),
        "cup_1": PlacementSpec.model_validate({"on": "table", "near": "thing"}),
    }
    spec = loaded.spec.model_copy(update={"world": loaded.spec.world.model_copy(update={"layout": layout})})
    return replace(world, slots=slots), spec


def test_variants_and_instances_by_presence() -> None:
    world, spec = varied()
    managers = standard_managers(spec, world, 3)
    layout = next(manager for manager in managers if manager.name == "layout")
    number = {entity.name: k for k, entity in enumerate(world.entities)}
    present = np.ones((3, len(world.entities)), dtype=bool)
    present[0, number["large"]] = present[1, number["small"]] = False
    present[2, [number["small"], number["large"], number["cup_0"]]] = False
    with NullEngine().create_world(world, 3) as engine:
        for manager in managers:
            manager.bind(engine)
        layout.streams.seed(0, np.arange(3))
        layout.streams.begin(np.arange(3))
        engine.reset(present=present)
        layout.reset(np.arange(3))
        pose = engine.get_state().body_pose
        root = {entity.name: entity.root for entity in world.entities}
        assert np.isclose(pose[0, root["small"], 2], 0.41)
        assert np.isclose(pose[1, root["large"], 2], 0.45)
        assert np.allclose(pose[:, root["cup_1"], 2], 0.415)
        names = set(layout.streams.draws[0])
        assert {"layout/thing/yaw", "layout/cup_0/place", "layout/cup_1/near"} <= names
        absent = set(layout.streams.draws[2])
        assert not any("thing" in name or "cup_0" in name for name in absent)
        assert "layout/cup_1/place" in absent, "what it would be near is not there: anywhere on the table"
        first = pose[0].copy()
        engine.reset([0])
        layout.reset(np.array([0]))
        assert np.array_equal(engine.get_state().body_pose[0], first)


def test_places_are_relative_to_the_origin_of_the_env() -> None:
    world, spec = varied()
    managers = standard_managers(spec, world, 2)
    layout = next(manager for manager in managers if manager.name == "layout")
    layout.episodes.origin[1] = [5.0, -3.0, 0.0]
    with NullEngine().create_world(world, 2) as engine:
        for manager in managers:
            manager.bind(engine)
        layout.streams.begin(np.arange(2), [7, 7])
        layout.reset(np.arange(2))
        pose = engine.get_state().body_pose
        root = [world.entities[k].root for k in range(len(world.entities)) if world.initial_presence[k]]
        assert np.allclose(pose[1, root, :3] - pose[0, root, :3], [5.0, -3.0, 0.0], atol=1e-9)
        assert np.allclose(pose[1, root, 3:], pose[0, root, 3:])
