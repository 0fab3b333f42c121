"""Couplings of a World as elements of an MjSpec: followers, frames that are held together, and tendons."""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from anysim.conventions import wxyz_from_xyzw
from anysim.model.world import ConstraintKind, SpatialTendon, Tendon, World, Wrap
from anysim_mujoco.audit import UNLIMITED
from anysim_mujoco.geoms import UNSEEN
from anysim_mujoco.mjcf.surfaces import DRY_IMPEDANCE, ConstraintFields, Stiffness


class CouplingBuilder:
    """Adds the couplings of one World; `owner` gives the element of a body, -1 for the world's."""

    def __init__(self, spec: Any, world: World, owner: Callable[[int], Any], stiff: Stiffness) -> None:
        self._spec, self._world, self._owner, self._stiff = spec, world, owner, stiff

    def add(self) -> None:
        """Add them all."""
        self._followers()
        self._constraints()
        for tendon in self._world.tendons:
            element = self._tendon(tendon)
            for joint, coefficient in zip(tendon.joints, tendon.coefficients, strict=True):
                element.wrap_joint(self._world.joints[joint].name, coefficient)
        for tendon in self._world.spatial_tendons:
            self._path(self._tendon(tendon), tendon)

    def _equality(self, name: str, kind: Any, objects: Any, names: tuple[str, ...], held: ConstraintFields) -> Any:
        return self._spec.add_equality(
            name=name,
            type=kind,
            objtype=objects,
            **dict(zip(("name1", "name2"), names, strict=False)),
            solref=held.solref,
            solimp=held.solimp,
        )

    def _followers(self) -> None:
        kind, objects = mujoco.mjtEq.mjEQ_JOINT, mujoco.mjtObj.mjOBJ_JOINT
        for joint in self._world.joints:
            if joint.mimic is None:
                continue
            names = joint.name, self._world.joints[joint.mimic.joint].name
            held = self._stiff.fields(joint.mimic_compliance, joint.limit_softness)
            equality = self._equality(f"{joint.name} (mimic)", kind, objects, names, held)
            data = np.zeros_like(equality.data)
            data[:2] = joint.mimic.offset, joint.mimic.multiplier
            data[2 : 2 + len(joint.mimic.curve)] = joint.mimic.curve
            equality.data = data

    def _constraints(self) -> None:
        """Frames that are held together, as sites: what MuJoCo makes of bodies depends on where they begin."""
        kinds = {ConstraintKind.CONNECT: mujoco.mjtEq.mjEQ_CONNECT, ConstraintKind.WELD: mujoco.mjtEq.mjEQ_WELD}
        for one in self._world.constraints:
            names = f"{one.name} (frame)", f"{one.name} (other frame)"
            ends = (one.body, one.position, one.quaternion), (one.other, one.other_position, one.other_quaternion)
            for name, (body, position, quaternion) in zip(names, ends, strict=True):
                self._owner(body).add_site(name=name, pos=position, quat=wxyz_from_xyzw(np.asarray(quaternion)))
            held = self._stiff.fields(one.compliance, one.softness)
            kind, site = kinds[one.kind], mujoco.mjtObj.mjOBJ_SITE
            equality = self._equality(f"{one.name} (constraint)", kind, site, names, held)
            data = np.zeros_like(equality.data)
            data[10] = one.turn_scale
            equality.data = data

    def _tendon(self, one: Tendon | SpatialTendon) -> Any:
        """A tendon without its path; one whose limits are equal is held at that length."""
        held = one.lower == one.upper
        limited = not held and bool(np.isfinite(one.lower) or np.isfinite(one.upper))
        limit = self._stiff.fields(one.limit_compliance, one.limit_softness)
        dry = self._stiff.fields(one.friction_compliance, impedance=DRY_IMPEDANCE)
        tendon = self._spec.add_tendon(
            name=one.name,
            stiffness=[one.stiffness, 0.0, 0.0],
            springlength=one.rest,
            damping=[one.damping, 0.0, 0.0],
            frictionloss=one.friction,
            armature=one.armature,
            solref_friction=dry.solref,
            solimp_friction=dry.solimp,
            limited=int(limited),
            range=(max(one.lower, -UNLIMITED), min(one.upper, UNLIMITED)) if limited else (0.0, 0.0),
            solref_limit=limit.solref,
            solimp_limit=limit.solimp,
            margin=limit.margin,
        )
        if held:
            kind, objects = mujoco.mjtEq.mjEQ_TENDON, mujoco.mjtObj.mjOBJ_TENDON
            equality = self._equality(f"{one.name} (held)", kind, objects, (one.name,), limit)
            data = np.zeros_like(equality.data)
            data[0] = one.lower
            equality.data = data
        return tendon

    def _path(self, element: Any, tendon: SpatialTendon) -> None:
        for number, point in enumerate(tendon.path):
            name = f"{tendon.name} (point {number})"
            if point.pulley:
                element.wrap_pulley(point.pulley)
            elif point.wrap is None:
                self._owner(point.body).add_site(name=name, pos=point.position)
                element.wrap_site(name)
            else:
                element.wrap_geom(*self._wrapped(name, point.body, point.position, point.wrap))

    def _wrapped(self, name: str, body: int, position: Any, wrap: Wrap) -> tuple[str, str]:
        """The names of a shape that a tendon lies around, which does not collide, and of its side's site."""
        kinds = mujoco.mjtGeom
        self._owner(body).add_geom(
            name=name,
            type=kinds.mjGEOM_CYLINDER if wrap.cylinder else kinds.mjGEOM_SPHERE,
            size=(wrap.radius, wrap.radius, 0.0),
            pos=position,
            quat=wxyz_from_xyzw(np.asarray(wrap.quaternion)),
            contype=0,
            conaffinity=0,
            group=UNSEEN,
            mass=0.0,
        )
        if wrap.side is None:
            return name, ""
        side = f"{name} side"
        self._owner(wrap.side_body).add_site(name=side, pos=wrap.side)
        return name, side
