"""Tendons and constraints keep to their joints and bodies where models are joined, and where entities come and go."""

from dataclasses import replace

import numpy as np

from anysim.assets.attach import attach
from anysim.assets.model import ActuatorHint, ImportedModel
from anysim.compile.builder import WorldBuilder
from anysim.compile.edit import without_entity
from anysim.model.world import (
    Body,
    BodyKind,
    Constraint,
    ConstraintKind,
    ControlMode,
    EntityKind,
    Inertial,
    Joint,
    JointType,
    Tendon,
    World,
)

ROD = Inertial(1.0, (0.0, 0.0, 0.0), (0.1, 0.1, 0.1, 0.0, 0.0, 0.0))


def fork(name: str) -> ImportedModel:
    """A base with two links, on a tendon with a drive, the second of which is held to the base."""
    bodies = (Body("base", BodyKind.STATIC), *(Body(n, BodyKind.LINK, 0, inertial=ROD) for n in ("a", "b")))
    return ImportedModel(
        name,
        bodies,
        joints=tuple(Joint(n, i + 1, JointType.REVOLUTE, (0.0, 0.0, 1.0)) for i, n in enumerate("ab")),
        links={"base": 0, "a": 1, "b": 2},
        actuator_hints=(ActuatorHint(0, ControlMode.EFFORT, 0.0, 0.0, 1.0, ((1, 2.0),)),),
        tendons=(Tendon("cord", (0, 1), (1.0, 2.0), stiffness=5.0),),
        constraints=(Constraint("pin", ConstraintKind.CONNECT, 2, 0, other_position=(0.1, 0.0, 0.0), softness=0.01),),
    )


def test_a_part_brings_its_own_to_where_it_is_fixed() -> None:
    whole = attach(fork("arm"), fork("hand"), "a", np.array([0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0]), "hand_")
    assert [joint.name for joint in whole.joints] == ["a", "hand_a", "hand_b", "b"]
    assert [(t.name, t.joints) for t in whole.tendons] == [("cord", (0, 3)), ("hand_cord", (1, 2))]
    assert [(h.joint, h.shares) for h in whole.actuator_hints] == [(0, ((3, 2.0),)), (1, ((2, 2.0),))]
    own, brought = whole.constraints
    assert (own.body, own.other, own.other_position) == (4, 0, (0.1, 0.0, 0.0))
    assert (brought.name, brought.body, brought.other) == ("hand_pin", 3, 1)
    assert (brought.other_position, brought.softness) == ((0.1, 0.0, 0.5), 0.01)


def test_they_go_with_their_entity() -> None:
    builder = WorldBuilder(World())
    for name in ("first", "second"):
        builder.add(name, EntityKind.OBJECT, fork(name), root=BodyKind.STATIC)
    world = builder.build()
    assert [t.joints for t in world.tendons] == [(0, 1), (2, 3)]
    assert [(c.body, c.other) for c in world.constraints] == [(2, 0), (5, 3)]
    left = without_entity(world, "first")
    assert [(t.name, t.joints) for t in left.tendons] == [("second.cord", (0, 1))]
    assert [(c.name, c.body, c.other) for c in left.constraints] == [("second.pin", 2, 0)]
    assert replace(left, tendons=(), constraints=()).hash != left.hash
