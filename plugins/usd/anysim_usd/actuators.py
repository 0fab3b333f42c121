"""MuJoCo's actuators of a stage as drives of joints: motors, position and velocity drives, with their gears."""

from collections.abc import Mapping
from math import inf
from typing import Any

import numpy as np

from anysim.assets.model import ActuatorHint, ImportNote, mode_of
from anysim.model.world import ControlMode
from anysim_usd.numbers import get, given
from anysim_usd.space import Space
from anysim_usd.structure import Structure


def actuators(
    structure: Structure,
    numbers: Mapping[str, tuple[int, bool]],
    taken: set[int],
    space: Space,
    notes: list[ImportNote],
) -> list[ActuatorHint]:
    """The drives that prims `MjcActuator` declare for joints, by path their number and whether they turn.

    Those in `taken` have a drive already, which counts.
    """
    found: list[ActuatorHint] = []
    for prim in structure.prims:
        if str(prim.GetTypeName()) != "MjcActuator":
            continue
        targets = [str(target) for target in prim.GetRelationship("mjc:target").GetForwardedTargets()]
        if targets and targets[0] not in numbers and structure.stage.GetPrimAtPath(targets[0]).GetTypeName() in _HINGES:
            continue  # of another tree
        hint = _hint(prim, targets, numbers, taken | {one.joint for one in found}, space)
        if isinstance(hint, str):
            notes.append(ImportNote("dropped", f"actuator '{prim.GetName()}'", hint))
        else:
            found.append(hint)
    return found


_HINGES = ("PhysicsRevoluteJoint", "PhysicsPrismaticJoint")


def _hint(
    prim: Any, targets: list[str], numbers: Mapping[str, tuple[int, bool]], taken: set[int], space: Space
) -> ActuatorHint | str:
    """The drive of an actuator; or why it is none."""
    if len(targets) != 1 or targets[0] not in numbers:
        return "does not drive a single hinge or slide, and is left out"
    joint, turns = numbers[targets[0]]
    if joint in taken:
        return "drives a joint that has a drive already, and is left out"
    if str(get(prim, "mjc:dynType") or "none") != "none" or str(get(prim, "mjc:gainType") or "fixed") != "fixed":
        return "has dynamics or a gain of its own; the neutral drive is a proportional-derivative one"
    gear, gain = _first(prim, "mjc:gear", 1.0), _first(prim, "mjc:gainPrm", 1.0)
    if gear == 0.0:
        return "has a gear of 0: it moves nothing"
    bias = get(prim, "mjc:biasPrm") if str(get(prim, "mjc:biasType") or "none") == "affine" else None
    stiffness, damping = (0.0 - float(v) for v in (*(bias or ()), 0.0, 0.0, 0.0)[1:3])
    mode = mode_of(gain, stiffness, damping)
    if mode is None:
        return "has a feedback that is no position or velocity error"
    limit = _range(prim, "force") * abs(gear)
    if mode is ControlMode.EFFORT:
        limit = min(limit, _range(prim, "ctrl") * abs(gear * gain))
    force = space.weight * space.unit ** (2 if turns else 1)
    rate = space.weight * (space.unit**2 if turns else 1.0) * gear * gear
    return ActuatorHint(joint, mode, stiffness * rate, damping * rate, limit * force)


def _first(prim: Any, name: str, otherwise: float) -> float:
    value = get(prim, name)
    return float(value[0]) if value is not None and len(value) else otherwise


def _range(prim: Any, what: str) -> float:
    """How far a range goes; without end where it does not count."""
    limited = str(get(prim, f"mjc:{what}Limited") or "auto")
    ends = [given(prim, f"mjc:{what}Range:{end}") for end in ("min", "max")]
    if limited == "false" or (limited == "auto" and ends == [None, None]):
        return inf
    return float(np.abs([end or 0.0 for end in ends]).max())
