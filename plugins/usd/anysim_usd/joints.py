"""Directions that a joint lets move, their limits, and what USD, PhysX, MuJoCo and Newton say of each."""

from math import degrees, inf, isfinite, radians
from typing import Any, NamedTuple

import numpy as np

from anysim.assets.model import ActuatorHint, ImportNote
from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.world import ControlMode
from anysim_usd.numbers import (
    DIRECTIONS,
    applied,
    authored,
    bound,
    directions,
    exact,
    exact_vector,
    get,
    given,
    real,
    same,
)
from anysim_usd.space import Space
from anysim_usd.structure import Tie

_CALLED: dict[str, str] = dict(zip(DIRECTIONS, ("x", "y", "z", "roll", "pitch", "yaw"), strict=True))
_AXES = {"X": np.array([1.0, 0.0, 0.0]), "Y": np.array([0.0, 1.0, 0.0]), "Z": np.array([0.0, 0.0, 1.0])}


class Motion(NamedTuple):
    """One direction of a joint. `unit` is what its positions of the file are multiplied by: radians or metres.

    `instances` are the names under which schemas with several instances speak of it.
    """

    suffix: str
    turns: bool
    axis: Array
    unit: float
    lower: float
    upper: float
    instances: tuple[str, ...]


class JointReader:
    """Reads joints of a stage. What an import scales is lengths; forces and drives stay, as of other files."""

    def __init__(self, space: Space, notes: list[ImportNote]) -> None:
        self._length, self._metres, self._kilograms, self._notes = space.metres, space.unit, space.weight, notes

    def _note(self, kind: Any, tie: Tie, message: str) -> None:
        self._notes.append(ImportNote(kind, f"joint '{tie.name}'", message))

    def motions(self, tie: Tie) -> list[Motion]:
        """What moves, in the order of a chain; none of a fixed joint."""
        prim = tie.prim
        if tie.kind == "PhysicsFixedJoint":
            return []
        if tie.kind in ("PhysicsRevoluteJoint", "PhysicsPrismaticJoint"):
            return [self._one(tie, tie.kind == "PhysicsRevoluteJoint")]
        if tie.kind == "PhysicsSphericalJoint":
            cone = [given(prim, f"physics:coneAngle{i}Limit") for i in (0, 1)]
            text = "; its cone is left out" if any(c is not None and 0 <= c < 180 for c in cone) else ""
            self._note("info", tie, f"is spherical, and becomes a chain of hinges .roll, .pitch and .yaw{text}")
            return [self._direction(tie, name, -inf, inf) for name in DIRECTIONS[3:]]
        found = [self._direction(tie, name, low, high) for name, low, high in directions(prim)]
        if len(found) > 1:
            names = ", ".join(f".{motion.suffix}" for motion in found)
            self._note("info", tie, f"moves in {len(found)} directions, and becomes a chain of joints {names}")
        return [found[0]._replace(suffix="")] if len(found) == 1 else found

    def _direction(self, tie: Tie, name: str, low: float, high: float) -> Motion:
        turns = name.startswith("rot")
        unit = radians(1.0) if turns else self._length
        general = "angular" if turns else "linear"
        return Motion(_CALLED[name], turns, _AXES[name[-1]], unit, low * unit, high * unit, (name, general))

    def _one(self, tie: Tie, turns: bool) -> Motion:
        letter = str(get(tie.prim, "physics:axis") or "X")
        unit = radians(1.0) if turns else self._length
        low, high = (real(tie.prim, f"physics:{end}Limit", way * inf) for end, way in (("lower", -1), ("upper", 1)))
        lower, upper = low * unit, high * unit
        if lower > upper or (lower == upper and not isfinite(lower)):
            self._note("repaired", tie, f"has limits [{low:g}, {high:g}], which is read as moving without end")
            lower, upper = -inf, inf
        instances = ("angular" if turns else "linear", f"{'rot' if turns else 'trans'}{letter}")
        whole = 1.0 if turns else self._length
        lower, upper = (float(v) * whole for v in exact_vector(tie.prim, "limits", np.array([lower, upper]) / whole))
        return Motion("", turns, _AXES.get(letter, _AXES["X"]), unit, lower, upper, instances)

    # ------------------------------------------------------------------ what acts on it

    def _of(self, tie: Tie, motion: Motion, pattern: str) -> float | None:
        """The number of a schema with instances, `*` being the name of one."""
        for instance in motion.instances:
            if (value := given(tie.prim, pattern.replace("*", instance))) is not None:
                return value
        return None

    def _first(self, tie: Tie, motion: Motion, *patterns: str) -> float | None:
        found = (self._of(tie, motion, pattern) if "*" in pattern else given(tie.prim, pattern) for pattern in patterns)
        return next((value for value in found if value is not None), None)

    def passive(self, tie: Tie, motion: Motion) -> dict[str, float]:
        """Damping, dry friction, armature, spring and limits of effort and speed of a joint, as a `Joint` has them."""
        prim = tie.prim
        armature = self._first(
            tie, motion, "physxJointAxis:*:armature", "physxJoint:armature", "mjc:armature", "newton:armature"
        )
        viscous = self._of(tie, motion, "physxJointAxis:*:viscousFrictionCoefficient")
        viscous = given(prim, "newton:damping") if viscous is None else viscous
        damping = given(prim, "mjc:damping") if viscous is None else viscous * (degrees(1.0) if motion.turns else 1.0)
        speed = self._first(
            tie, motion, "physxJointAxis:*:maxJointVelocity", "physxJoint:maxJointVelocity", "newton:velocityLimit"
        )
        effort = bound(self._of(tie, motion, "drive:*:physics:maxForce"))
        own, whole = given(prim, "anysim:driveLimit"), given(prim, "anysim:effortLimit")
        if own is not None and whole is not None and same(own, effort):
            effort = whole  # of the joint, beside that of its drive
        way = radians(1.0) if motion.turns else 1.0
        rough = {  # in units of the file, turns in radians
            "velocityLimit": bound(None if speed is None else speed * way),
            "effortLimit": effort,
            "damping": damping or 0.0,
            "friction": self._friction(tie, motion),
            "armature": armature or 0.0,
            "stiffness": given(prim, "mjc:stiffness") or 0.0,
            "springRest": (given(prim, "mjc:springref") or 0.0) * way,
        }
        if not motion.suffix:
            rough = {name: self._exact(prim, name, value) for name, value in rough.items()}
        squared = self._kilograms * (self._metres**2 if motion.turns else 1.0)
        return {
            "velocity_limit": rough["velocityLimit"] * (1.0 if motion.turns else self._metres),
            "effort_limit": rough["effortLimit"] * self._force(motion),
            "damping": rough["damping"] * self._rate(motion),
            "friction": rough["friction"] * self._force(motion),
            "armature": rough["armature"] * squared,
            "stiffness": rough["stiffness"] * self._rate(motion),
            "spring_rest": rough["springRest"] * (1.0 if motion.turns else self._length),
            "limit_softness": given(prim, "anysim:limitSoftness") or 0.0,
        }

    def _exact(self, prim: Any, name: str, rough: float) -> float:
        """The number that anysim has written: where the schemas say nothing, or the same."""
        found = given(prim, f"anysim:{name}")
        if found is not None and rough in (0.0, inf):
            return found
        return exact(prim, name, rough)

    def _friction(self, tie: Tie, motion: Motion) -> float:
        """The dry friction, of what the schemas have for it."""
        found = self._first(
            tie, motion, "physxJointAxis:*:dynamicFrictionEffort", "mjc:frictionloss", "newton:friction"
        )
        held = self._of(tie, motion, "physxJointAxis:*:staticFrictionEffort")
        if found is not None and held is not None and held != found:
            self._note("info", tie, f"holds up to {held:g} at rest and {found:g} when it moves; friction is the second")
        if found is None and held is None and (found := given(tie.prim, "physxJoint:jointFriction")):
            self._note("info", tie, f"has a friction of {found:g} in PhysX, a coefficient; taken as a dry friction")
        return (held if found is None else found) or 0.0

    def _force(self, motion: Motion) -> float:
        """What a force, or a torque, of the file is multiplied by."""
        return self._kilograms * self._metres ** (2 if motion.turns else 1)

    def _rate(self, motion: Motion) -> float:
        """What a damping or stiffness of the file, per radian or length, is multiplied by."""
        return self._kilograms * (self._metres**2 if motion.turns else 1.0)

    def start(self, tie: Tie, motion: Motion, between: Array) -> float:
        """Where the joint is at first: as the file says, else as its bodies stand, which is `between` its frames."""
        stated = self._of(tie, motion, "state:*:physics:position")
        if stated is not None:
            rough = stated * motion.unit
        else:
            rough = along(motion, between)
        whole = 1.0 if motion.turns else self._length
        found = None if motion.suffix else given(tie.prim, "anysim:initial")
        return found * whole if found is not None and abs(found * whole - rough) < 1e-4 else rough

    def hint(self, tie: Tie, motion: Motion, joint: int) -> ActuatorHint | None:
        """The drive of a joint that the file declares."""
        prim = tie.prim
        instance = next((i for i in motion.instances if f"PhysicsDriveAPI:{i}" in applied(prim)), None)
        if instance is None or get(prim, "anysim:undriven"):
            return None
        drive = f"drive:{instance}:physics"
        if str(get(prim, f"{drive}:type") or "force") != "force":
            self._note("dropped", tie, "has a drive that gives accelerations, not forces, which is left out")
            return None
        per = 1.0 / radians(1.0) if motion.turns else 1.0
        kp, kd = (real(prim, f"{drive}:{key}", 0.0) * per * self._rate(motion) for key in ("stiffness", "damping"))
        if not motion.suffix:
            unit = self._rate(motion)
            kp, kd = exact(prim, "driveStiffness", kp / unit) * unit, exact(prim, "driveDamping", kd / unit) * unit
        if not (isfinite(kp) and isfinite(kd)) or kp < 0 or kd < 0:
            self._note("dropped", tie, f"has a drive with a stiffness of {kp:g} and a damping of {kd:g}, which is none")
            return None
        limit = bound(given(prim, f"{drive}:maxForce")) * self._force(motion)
        if not motion.suffix and authored(prim, "anysim:driveLimit"):
            limit = exact(prim, "driveLimit", limit / self._force(motion)) * self._force(motion)
        mode = ControlMode.POSITION if kp > 0 else ControlMode.VELOCITY if kd > 0 else ControlMode.EFFORT
        return ActuatorHint(joint, mode, kp, kd, limit)


def along(motion: Motion, pose: Array) -> float:
    """How far a direction is gone [rad or m] in a pose (7,)."""
    if not motion.turns:
        return float(motion.axis @ pose[:3])
    turn = pose[3:] if pose[6] >= 0 else -pose[3:]
    return float(2.0 * np.arctan2(motion.axis @ turn[:3], turn[3]))


def moved(motion: Motion, position: float) -> Array:
    """The pose (7,) of a joint's second frame in its first."""
    if not motion.turns:
        return np.array([*(motion.axis * position), 0.0, 0.0, 0.0, 1.0])
    return np.array([0.0, 0.0, 0.0, *P.from_axis_angle(motion.axis, np.array(position))])
