"""Entities that come and go at resets, on the kinematic engine: the contract of the base class."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.compile.edit import without_entity
from anysim.compile.world import compile_world
from anysim.errors import CapabilityError, EngineError
from anysim.model.world import Slot, World
from anysim.testing.kinematic import NullEngine
from anysim_schemas.run import WorldSpec


@pytest.fixture
def world() -> World:
    """A table, and a mug that is a ball or a box."""
    names = {"table": {"box": [1, 1, 0.2]}, "mug~0": {"sphere": 0.05}, "mug~1": {"box": [0.1, 0.1, 0.1]}}
    objects = {name.replace("~", "_"): {"source": source} for name, source in names.items()}
    made = compile_world(WorldSpec.model_validate({"objects": objects}))
    return replace(made, slots=(Slot("mug", "mug", 0, (1, 2)),))


def test_the_first_of_a_slot_is_there_after_the_build(world: World) -> None:
    with NullEngine().create_world(world, 2) as engine:
        assert engine.presence.tolist() == [[True, True, False]] * 2


def test_a_reset_changes_presence_and_the_next_keeps_it(world: World) -> None:
    with NullEngine().create_world(world, 3) as engine:
        engine.reset([1], present=np.array([[True, False, True]]))
        engine.reset()
        assert engine.presence.tolist() == [[True, True, False], [True, False, True], [True, True, False]]


def test_what_is_absent_reads_as_the_world_frame_whatever_is_written_to_it(world: World) -> None:
    with NullEngine().create_world(world, 2) as engine:
        there = engine.get_state().body_pose[:, 1].copy()
        engine.reset([0], present=np.array([[True, False, False]]))
        poses = np.tile([0.3, 0.2, 1.0, 0.0, 0.0, 0.0, 1.0], (2, 1, 1))
        engine.set_body_state(poses, np.ones((2, 1, 6)), bodies=[1])
        state = engine.get_state()
        assert state.body_pose[0, 1].tolist() == [0, 0, 0, 0, 0, 0, 1]
        assert state.body_twist[0, 1].tolist() == [0] * 6
        assert state.body_pose[1, 1].tolist() == poses[1, 0].tolist()
        engine.reset([0], present=np.array([[True, True, False]]))
        assert engine.get_state().body_pose[0, 1].tolist() == there[0].tolist()


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ([True, True, True], "env 1: 'mug' can be one of mug_0 and mug_1, not several"),
        ([False, True, False], "'table' is in no slot of the world, so it is present in every env"),
        ([True, True], r"present must be a bool array of shape \(1, 3\), got bool \(1, 2\)"),
    ],
)
def test_rows_that_no_env_can_have_are_refused(world: World, row: list[bool], message: str) -> None:
    with NullEngine().create_world(world, 2) as engine:
        with pytest.raises(EngineError, match=message):
            engine.reset([1], present=np.array([row]))
        assert engine.presence.tolist() == [[True, True, False]] * 2


def test_a_snapshot_brings_back_what_was_present(world: World) -> None:
    with NullEngine().create_world(world, 2) as engine:
        engine.reset([0], present=np.array([[True, False, True]]))
        saved = engine.snapshot([0])
        engine.reset([0], present=np.array([[True, True, False]]))
        engine.restore(saved, [1])
        assert engine.presence.tolist() == [[True, True, False], [True, False, True]]


def test_an_engine_that_cannot_refuses_the_world(world: World) -> None:
    class Rigid(NullEngine):
        capabilities = replace(
            NullEngine.capabilities,
            supported={c: s for c, s in NullEngine.capabilities.supported.items() if "vary" not in c},
        )

    with pytest.raises(CapabilityError, match="'mug' is not the same in every env"):
        Rigid().create_world(world)


def test_removing_an_entity_leaves_the_rest_of_its_slot(world: World) -> None:
    assert without_entity(world, "mug_0").slots == (Slot("mug", "mug", 0, (1,)),)
    assert without_entity(world, "table").slots == (Slot("mug", "mug", 0, (0, 1)),)
    assert without_entity(without_entity(world, "mug_0"), "mug_1").slots == ()
