"""Tendons and equalities of an MJCF file, as tendons, constraints and mimic joints of the neutral model.

MuJoCo measures equalities of joints and tendons from the file's reference positions; positions here begin at the file's
zero, so that polynomials are expanded about it.
"""

from collections.abc import Callable, Iterator, Mapping
from math import inf
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.polynomial import Polynomial

from anysim.conventions import WORLD, Array
from anysim.errors import AssetError
from anysim.math import pose as P
from anysim.model.hash import split
from anysim.model.world import (
    Compliance,
    Constraint,
    ConstraintKind,
    Mimic,
    SpatialTendon,
    Tendon,
    Vec3,
    Waypoint,
    Wrap,
)
from anysim_mujoco.mjcf.compliance import constraint_compliance, softness
from anysim_mujoco.mjcf.geoms import pose_of
from anysim_mujoco.mjcf.unheld import tendon_effects

_JOINT_WRAP = int(mujoco.mjtWrap.mjWRAP_JOINT)


class Following(NamedTuple):
    """A joint of the model that follows another; joints are neutral ones."""

    follower: int
    mimic: Mimic
    compliance: Compliance | None


class Couplings:
    """What couples the joints and bodies of one compiled file."""

    def __init__(
        self,
        model: Any,
        scale: float,
        number: Mapping[int, int],
        unit: Callable[[int], float],
        frames: Mapping[int, tuple[int, Array]],
        floating: bool,
        origin: Array,
    ) -> None:
        """With neutral joints and what lengths along them are scaled with by MuJoCo joint (`number`, `unit`).

        `frames` has by MuJoCo body the neutral one and the pose in it; `floating`: whether the root moves freely, else
        `origin` (7,) is that of the file in it.
        """
        self.model, self.scale, self.number, self.unit = model, scale, number, unit
        self.frames, self.floating, self.origin = frames, floating, origin

    # ------------------------------------------------------------------ tendons

    def path(self, t: int) -> tuple[list[int], list[float]]:
        """The MuJoCo joints of fixed tendon `t` and their coefficients; empty for a spatial one."""
        first = int(self.model.tendon_adr[t])
        places = range(first, first + int(self.model.tendon_num[t]))
        if any(int(self.model.wrap_type[w]) != _JOINT_WRAP for w in places):
            return [], []
        joints = [int(self.model.wrap_objid[w]) for w in places]
        return joints, [float(self.model.wrap_prm[w]) for w in places]

    def tendons(self) -> Iterator[Tendon]:
        """The fixed tendons that pull, damp, limit, or hold more than two joints."""
        held = self._held()
        for t in range(self.model.ntendon):
            joints, coefficients = self.path(t)
            if not joints or not (t in held or set(tendon_effects(self.model, t)) & _HELD):
                continue
            unit = self.scale if all(self.unit(j) == self.scale for j in joints) else 1.0
            yield Tendon(
                joints=tuple(self.number[j] for j in joints),
                coefficients=tuple(c * unit / self.unit(j) for j, c in zip(joints, coefficients, strict=True)),
                **self._common(t, held.get(t), unit),
            )

    def spatial_tendons(self) -> Iterator[SpatialTendon]:
        """Those through space that pull, damp, limit or hold."""
        held = self._held()
        for t in range(self.model.ntendon):
            if not self.path(t)[0] and (t in held or set(tendon_effects(self.model, t)) & _HELD):
                yield SpatialTendon(path=tuple(self._points(t)), **self._common(t, held.get(t), self.scale))

    def _held(self) -> dict[int, int]:
        """The equalities that hold a tendon's length, by the tendon."""
        model = self.model
        return {
            int(model.eq_obj1id[e]): e
            for e in range(model.neq)
            if model.eq_type[e] == mujoco.mjtEq.mjEQ_TENDON and model.eq_active0[e] and model.eq_obj2id[e] < 0
            if not self._ties_two(int(model.eq_obj1id[e]))
        }

    def _common(self, t: int, held: int | None, unit: float) -> dict[str, Any]:
        """What all tendons have; `held` is the equality that holds it."""
        model = self.model
        lower, upper = (float(v) * unit for v in model.tendon_range[t]) if model.tendon_limited[t] else (-inf, inf)
        if held is not None:
            lower = upper = float(model.tendon_length0[t] + model.eq_data[held, 0]) * unit
            ends = model.eq_solref[held], model.eq_solimp[held], 0.0
        else:
            ends = model.tendon_solref_lim[t], model.tendon_solimp_lim[t], float(model.tendon_margin[t])
        dry = constraint_compliance(model.tendon_solref_fri[t], model.tendon_solimp_fri[t], unit=unit)
        short, long = (float(v) * unit for v in model.tendon_lengthspring[t])
        return {
            "name": model.tendon(t).name or f"tendon{t}",
            "stiffness": float(model.tendon_stiffness[t]),
            "damping": float(model.tendon_damping[t]),
            "rest": (short, long),
            "lower": lower,
            "upper": upper,
            "friction": float(model.tendon_frictionloss[t]),
            "armature": float(model.tendon_armature[t]),
            "limit_softness": softness(ends[0]),
            "limit_compliance": constraint_compliance(*ends, unit=unit) if lower > -inf or upper < inf else None,
            "friction_compliance": dry if model.tendon_frictionloss[t] else None,
        }

    def _points(self, t: int) -> Iterator[Waypoint]:
        """The path of a spatial tendon."""
        model, first = self.model, int(self.model.tendon_adr[t])
        for w in range(first, first + int(model.tendon_num[t])):
            kind, thing = int(model.wrap_type[w]), int(model.wrap_objid[w])
            if kind == int(mujoco.mjtWrap.mjWRAP_PULLEY):
                yield Waypoint(pulley=float(model.wrap_prm[w]))
            elif kind == int(mujoco.mjtWrap.mjWRAP_SITE):
                yield Waypoint(*self._site(thing))
            else:
                own = pose_of(model.geom_pos[thing], model.geom_quat[thing], self.scale)
                body, frame = self._place(int(model.geom_bodyid[thing]), own)
                position, quaternion = split(frame)
                side = int(model.wrap_prm[w])
                side_body, point = self._site(side) if side >= 0 else (WORLD, None)
                radius = float(model.geom_size[thing, 0]) * self.scale
                cylinder = kind == int(mujoco.mjtWrap.mjWRAP_CYLINDER)
                yield Waypoint(body, position, Wrap(radius, cylinder, quaternion, point, side_body))

    def _site(self, s: int) -> tuple[int, Vec3]:
        own = pose_of(self.model.site_pos[s], self.model.site_quat[s], self.scale)
        body, frame = self._place(int(self.model.site_bodyid[s]), own)
        return body, split(frame)[0]

    def _place(self, number: int, local: Array) -> tuple[int, Array]:
        """The neutral body of a MuJoCo body, and a pose (7,) of that in it.

        Raises:
            AssetError: a string ties a model that floats to the world, whose place in it is the world's.
        """
        if number == 0 and self.floating:
            raise AssetError(
                "a spatial tendon ties it to the world, and the model floats: where it stands is the world's to say; "
                "leave the tendon out"
            )
        body, frame = self.frames[number] if number else (0, self.origin)
        return body, P.compose(frame, local)

    # ------------------------------------------------------------------ joints that follow others

    def following(self) -> Iterator[Following]:
        """The joints that equalities of joints, and of tendons of two joints, make follow another.

        Raises:
            AssetError: an equality holds a joint still.
        """
        model = self.model
        followers: set[int] = set()
        for e in range(model.neq):
            if not model.eq_active0[e]:
                continue
            kind, one, other = int(model.eq_type[e]), int(model.eq_obj1id[e]), int(model.eq_obj2id[e])
            found = None
            if kind == mujoco.mjtEq.mjEQ_JOINT:
                if other < 0:
                    name = model.joint(one).name
                    raise AssetError(f"an equality holds joint '{name}' still; leave the joint out instead")
                start, reach = (float(model.qpos0[model.jnt_qposadr[j]]) for j in (one, other))
                curve = Polynomial(model.eq_data[e, :5])(Polynomial([-reach, 1.0])) + start
                found = one, other, curve
            elif kind == mujoco.mjtEq.mjEQ_TENDON and other < 0 and self._ties_two(one):
                (a, b), (ca, cb) = self.path(one)
                held = float(model.tendon_length0[one] + model.eq_data[e, 0])
                if self.number[b] in followers:
                    (a, b), (ca, cb) = (b, a), (cb, ca)
                found = b, a, Polynomial([held / cb, -ca / cb])
            if found is not None:
                follower, leader, curve = found
                followers.add(self.number[follower])
                tie = constraint_compliance(model.eq_solref[e], model.eq_solimp[e], unit=self.unit(follower))
                yield Following(self.number[follower], self._mimic(follower, leader, curve), tie)

    def _ties_two(self, t: int) -> bool:
        """Whether tendon `t` is one of two joints: an equality of it makes one of them follow the other."""
        joints, coefficients = self.path(t)
        return len(joints) == 2 and len(set(joints)) == 2 and all(coefficients)

    def untied(self, e: int) -> str:
        """Why the equality of tendons `e` is left out; empty where it is not."""
        return "ties two tendons" if self.model.eq_obj2id[e] >= 0 else ""

    def _mimic(self, follower: int, leader: int, curve: Polynomial) -> Mimic:
        own, unit = self.unit(follower), self.unit(leader)
        offset, multiplier, *higher = (float(c) * own / unit**k for k, c in enumerate([*curve.coef, 0.0, 0.0]))
        while higher and higher[-1] == 0.0:
            higher.pop()
        return Mimic(self.number[leader], multiplier, offset, tuple(higher))

    # ------------------------------------------------------------------ bodies that are held together

    def constraints(self) -> Iterator[Constraint]:
        """The connects and welds.

        Raises:
            AssetError: one ties a model that floats to the world, whose place in it is the world's.
        """
        kinds = {
            int(mujoco.mjtEq.mjEQ_CONNECT): ConstraintKind.CONNECT,
            int(mujoco.mjtEq.mjEQ_WELD): ConstraintKind.WELD,
        }
        model = self.model
        for e in range(model.neq):
            kind = kinds.get(int(model.eq_type[e]))
            if kind is None or not model.eq_active0[e]:
                continue
            name = model.eq(e).name or f"{kind}{e}"
            (body, frame), (other, other_frame) = (self._end(e, side, kind, name) for side in (0, 1))
            if body == WORLD:
                (body, frame), (other, other_frame) = (other, other_frame), (body, frame)
            scale = float(model.eq_data[e, 10]) if kind is ConstraintKind.WELD else 1.0
            yield Constraint(
                name,
                kind,
                body,
                other,
                *split(frame),
                *split(other_frame),
                softness(model.eq_solref[e]),
                constraint_compliance(model.eq_solref[e], model.eq_solimp[e], unit=self.scale),
                scale if scale == 1.0 else scale * self.scale,
            )

    def _end(self, e: int, side: int, kind: ConstraintKind, name: str) -> tuple[int, Array]:
        """The neutral body of one side of an equality, and the frame in it that is held."""
        model = self.model
        thing, data = int((model.eq_obj1id, model.eq_obj2id)[side][e]), np.asarray(model.eq_data[e], dtype=float)
        if model.eq_objtype[e] == mujoco.mjtObj.mjOBJ_SITE:
            body = int(model.site_bodyid[thing])
            local = pose_of(model.site_pos[thing], model.site_quat[thing], self.scale)
        else:
            body = thing
            turn = data[6:10] if kind is ConstraintKind.WELD and side == 0 else np.array([1.0, 0.0, 0.0, 0.0])
            # a weld has the second body's point first, a connect that of the first
            start = 3 * ((1 - side) if kind is ConstraintKind.WELD else side)
            local = pose_of(data[start : start + 3], turn, self.scale)
        if body == 0 and self.floating:
            raise AssetError(
                f"the equality '{name}' is a {kind} to the world, and the model floats: where it stands is the world's "
                f"to say; fix it with `base: fixed` in place of the equality, or leave that out"
            )
        number, frame = self.frames[body] if body else (0, self.origin)
        return number, P.compose(frame, local)


_HELD = {"pull as springs", "damp", "rub", "add inertia", "limit a length"}
