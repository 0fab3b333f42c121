"""MJCF to the parts of a World, from MuJoCo's own compiled reading of the file.

Rules where the neutral model is narrower; each use is a note in the report:
- One kinematic tree, of several the one that is asked for: geoms of the world beside it, cameras and lights stay
  behind, its sensors are hints. A tree whose first body has hinges or slides gets a fixed base at the file's origin.
- Bodies without a joint are lumped into their parent; the frame survives as a site, the inertia is composed exactly.
- A body with several joints becomes a chain: each extra link takes a share of `JOINT_SHARE` of its mass and inertia,
  and the body still collides with neither its parent nor what it did not collide with.
- Sites and bodies share their names here: a site that is called like a body is found as `<body>.<site>`.
- Joint positions keep the file's zero, whatever its `ref`. A keyframe `home` gives the initial ones.
- Equalities of joints, and of tendons of two joints, become mimics, and a tendon of more is held. Drives that are no
  position, velocity or motor drive of a joint or fixed tendon are dropped. Ball joints and flexes are refused.
- Solver settings of contacts, limits, dry friction and ties are kept as their compliance where the file sets them.
"""

from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any, Literal

import mujoco
import numpy as np

from anysim import cache
from anysim.assets.meshes import VISUAL_ERROR
from anysim.assets.model import ActuatorHint, ImportedModel, ImportNote, SensorHint
from anysim.assets.scene import PART
from anysim.conventions import Array
from anysim.errors import AssetError, listing
from anysim.kinematics import inertia
from anysim.math import pose as P
from anysim.model.hash import split, tidy
from anysim.model.world import Body, BodyKind, Geom, Inertial, Joint, JointType, Site
from anysim_mujoco.inertia import full
from anysim_mujoco.mjcf.compliance import constraint_compliance, softness
from anysim_mujoco.mjcf.couplings import Couplings
from anysim_mujoco.mjcf.drives import drive_hint, left_out, shared
from anysim_mujoco.mjcf.file import compiled
from anysim_mujoco.mjcf.geoms import GeomReader, pose_of
from anysim_mujoco.mjcf.pairs import PairReader, of_pairs
from anysim_mujoco.mjcf.part import unqualified
from anysim_mujoco.mjcf.sensors import SensorReader, told_of
from anysim_mujoco.mjcf.unheld import of_tendons

_IDENTITY = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
JOINT_SHARE, _LIGHTEST = 1e-6, 1e-13
"""The share of a body's mass and inertia that a link gets for each of its joints but the last: a millionth, so that on
MuJoCo a body goes within 1e-5 of its way, unless that would leave a moment [kg m^2] below the second number."""
_HINGE, _SLIDE = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE


def import_mjcf(
    path: Path, *, root: Path, scale: float = 1.0, body: str = "", visual_error: float = VISUAL_ERROR
) -> ImportedModel:
    """Read an MJCF file; see `anysim.assets.model.Importer` for the arguments.

    Raises:
        AssetError: a missing or damaged file, a reference that leaves `root`, something the neutral model cannot say.
    """
    notes: list[ImportNote] = []
    model = _MjcfImport(compiled(path, root, body, notes), path, scale, visual_error, notes)
    return unqualified(model.run(body), body[1:]) if body.startswith(PART) else model.run()


class _MjcfImport:
    """One import: walks MuJoCo's bodies, which are depth first with children in source order."""

    def __init__(self, model: Any, path: Path, scale: float, visual_error: float, notes: list[ImportNote]) -> None:
        self.model, self.path, self.scale, self.notes = model, path, scale, notes
        self.links = _named([model.body(i).name for i in range(model.nbody)], "body")
        self.joint_names = _named([model.joint(j).name for j in range(model.njnt)], "joint")
        self.virtual: dict[int, int] = {}  # neutral body: the one with mass that it is a part of
        self.bodies: list[Body] = []
        self.inertials: list[list[Inertial]] = []
        self.joints: list[Joint] = []
        self.sites: list[Site] = []
        self.place: dict[str, int] = {}
        self.frames: dict[int, tuple[int, Array]] = {}  # MuJoCo body: neutral body, pose in it
        self.number: dict[int, int] = {}  # MuJoCo joint: neutral joint
        self.site_names: dict[int, str] = {}  # of MuJoCo's sites
        source = cache.digest(path.read_bytes(), model.mesh_vert.tobytes(), model.mesh_face.tobytes())
        self.geometry = GeomReader(model, source, scale, visual_error, self.notes)

    def run(self, part: str = "") -> ImportedModel:
        self._refuse_the_unsayable()
        self.top = top = 0 if part == PART else self._top(bool(part))
        for number in range(top, self.model.nbody):
            self._body(number, top)
        self._sites()
        couplings = self._couplings()
        self._inertials()
        geometry = self.geometry
        sensors = self._sensors(bool(part))
        return ImportedModel(
            name=self.path.stem,
            bodies=tuple(self.bodies),
            joints=tuple(self.joints),
            geoms=tuple(self._of_parts(geometry)),
            geom_links=tuple(geometry.geom_links),
            sites=tuple(self.sites),
            meshes=tuple(geometry.meshes.values()),
            heightfields=tuple(geometry.heightfields.values()),
            links=self.place,
            actuator_hints=self._hints(couplings),
            excluded_pairs=PairReader(self.model, self.geometry, self.bodies, self.links, self.notes).excluded(
                self.virtual
            ),
            tendons=tuple(couplings.tendons()),
            constraints=tuple(couplings.constraints()),
            spatial_tendons=tuple(couplings.spatial_tendons()),
            sensors=sensors,
            report=tuple(self.notes),
            wholes=geometry.wholes,
        )

    # ------------------------------------------------------------------ the tree

    def _refuse_the_unsayable(self) -> None:
        model = self.model
        for j in range(model.njnt):
            if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_BALL:
                raise AssetError(
                    f"{self._joint_name(j)} of {self.path} is a ball joint; the neutral model has hinges and slides"
                )
        if model.nflex:
            raise AssetError(f"{self.path}: holds {model.nflex} flexes; the neutral model has rigid bodies")
        self.notes += of_tendons(model)

    def _top(self, part: bool) -> int:
        model = self.model
        tops = [i for i in range(1, model.nbody) if model.body_parentid[i] == 0]
        if len(tops) != 1:
            names = listing([self.links[i] for i in tops], 6)
            say = f"; name the one that is meant: {self.path.name}#{self.links[tops[0]]}" if tops else ""
            raise AssetError(f"{self.path}: an asset has exactly one body in its world; this one has {names}{say}")
        if part:
            return tops[0]
        if model.body_geomnum[0]:
            self._note("dropped", "world", f"{model.body_geomnum[0]} geoms of the world beside the model are left out")
        if sites := int((model.site_bodyid == 0).sum()):
            self._note("dropped", "world", f"{sites} sites of the world beside the model are left out")
        return tops[0]

    def _rest(self, number: int) -> Array:
        return pose_of(self.model.body_pos[number], self.model.body_quat[number], self.scale)

    def _body(self, number: int, top: int) -> None:
        model, link = self.model, self.links[number]
        joints = range(model.body_jntadr[number], model.body_jntadr[number] + model.body_jntnum[number])
        floating = any(model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE for j in joints)
        rest = self._rest(number)
        if number == top and (floating or not joints):
            kind = BodyKind.FREE if floating else BodyKind.STATIC
            self._add_body(Body(link, kind, gravity_compensation=floating and self._compensated(number)))
            self.frames[number] = 0, _IDENTITY
        else:
            if number == top:
                self._note("info", link, "moves against the world; it gets a fixed base at the file's origin")
                self._add_body(Body(_free("base", self.links), BodyKind.STATIC))
            parent, frame = self.frames.get(model.body_parentid[number], (0, _IDENTITY))
            self.frames[number] = self._attach(link, joints, parent, P.compose(frame, rest))
        body, pose = self.frames[number]
        self.place[link] = body
        mass, com = float(model.body_mass[number]), tidy(np.asarray(model.body_ipos[number]) * self.scale)
        tensor = full(model.body_inertia[number], model.body_iquat[number]) * self.scale**5
        local = Inertial(mass * self.scale**3, com, tuple(float(v) for v in tensor))  # type: ignore[arg-type]
        self.inertials[body].append(inertia.moved(local, pose))
        self.geometry.read(link, number, body, pose)

    def _attach(self, link: str, joints: range, parent: int, rest: Array) -> tuple[int, Array]:
        """Put a link onto a body: rigidly without joints, else through one body per joint. Returns body and pose."""
        if not joints:
            self.sites.append(Site(link, parent, *split(rest)))
            return parent, rest
        first = len(self.bodies)
        for j in joints:
            last = j == joints[-1]
            name = (
                link if last else _free(f"{link}.{self._joint_name(j)}", [*self.links, *(b.name for b in self.bodies)])
            )
            rest = P.compose(rest, self._motion(j, -float(self.model.qpos0[self.model.jnt_qposadr[j]])))
            compensated = self._compensated(int(self.model.jnt_bodyid[j]))
            body = self._add_body(Body(name, BodyKind.LINK, parent, *split(rest), gravity_compensation=compensated))
            self.number[j] = len(self.joints)
            self.joints.append(self._joint(j, body))
            parent, rest = body, _IDENTITY
        self.virtual |= dict.fromkeys(range(first, parent), parent)
        return parent, _IDENTITY

    def _compensated(self, number: int) -> bool:
        """Gravity compensation is all or nothing in the neutral model."""
        share = float(self.model.body_gravcomp[number])
        if share not in (0.0, 1.0):
            now = "all" if share >= 0.5 else "none"
            self._note("repaired", self.links[number], f"is relieved of {share:g} of its weight, now of {now}")
        return share >= 0.5

    def _add_body(self, body: Body) -> int:
        self.bodies.append(body)
        self.inertials.append([])
        return len(self.bodies) - 1

    def _inertials(self) -> None:
        totals = [inertia.composed([part for part in parts if part.mass > 0]) for parts in self.inertials]
        shares = {body: _share_of(totals[body]) for body in self.virtual.values()}
        for i, body in enumerate(self.bodies):
            total = totals[i]
            if i in self.virtual:
                total = self._share(i, totals[self.virtual[i]], shares[self.virtual[i]])
            elif i in shares:
                count = sum(whole == i for whole in self.virtual.values())
                total = inertia.scaled(total, 1.0 - count * shares[i])
            if body.kind is not BodyKind.STATIC:
                total, text = inertia.repaired(total)
                if text is not None:
                    self._note("repaired", body.name, text)
                total = inertia.moving(total)
            self.bodies[i] = replace(body, inertial=total, virtual=i in self.virtual)

    def _share(self, virtual: int, whole: Inertial, share: float) -> Inertial:
        """The inertial of an extra link of a body that has this one: as the body lies at the file's zero."""
        pose, body = _IDENTITY, self.virtual[virtual]
        for link in range(virtual + 1, body + 1):
            pose = P.compose(pose, P.pose(self.bodies[link].position, self.bodies[link].quaternion))
        text = f"stands for one of the joints of '{self.bodies[body].name}', and takes {share:g} of its mass"
        self._note("repaired", self.bodies[virtual].name, f"{text}: {share * whole.mass:.3g} kg")
        return inertia.moved(inertia.scaled(whole, share), pose)

    def _of_parts(self, geometry: GeomReader) -> Iterator[Geom]:
        """The geoms; those that collide, of bodies that are lumped of several, with the centre of mass of their own."""
        parts = Counter(body for body, _ in self.frames.values())
        for geom, number in zip(geometry.geoms, geometry.numbers, strict=True):
            part = int(self.model.geom_bodyid[number])
            if geom.collides and parts[geom.body] > 1:
                inner = pose_of(self.model.body_ipos[part], self.model.body_iquat[part], self.scale)
                com = P.compose(self.frames[part][1], inner)[:3]
                yield replace(geom, part_com=tidy(com))
            else:
                yield geom

    def _sites(self) -> None:
        model, taken = self.model, {*self.links, *(body.name for body in self.bodies)}
        for s, given in enumerate(_named([model.site(s).name for s in range(model.nsite)], "site")):
            number = int(model.site_bodyid[s])
            if number not in self.frames:
                continue
            body, frame = self.frames[number]
            name = given if given not in taken else _free(f"{self.links[number]}.{given}", taken)
            if name != given:
                self._note("info", f"site '{given}'", f"is found as '{name}': a body has its name")
            taken.add(name)
            self.site_names[s] = name
            pose = P.compose(frame, pose_of(model.site_pos[s], model.site_quat[s], self.scale))
            self.sites.append(Site(name, body, *split(pose)))

    def _sensors(self, part: bool) -> tuple[SensorHint, ...]:
        """Those of the file; a scene makes sensors of those of its parts."""
        parts = Counter(body for body, _ in self.frames.values())
        joined = frozenset(number for number, (body, _) in self.frames.items() if parts[body] > 1)
        hints, notes = SensorReader(self.model, self.site_names, self.links, joined, self.scale).read()
        self.notes += [*notes, *([] if part else [*told_of(hints), *of_pairs(self.model)])]
        return tuple(hints)

    # ------------------------------------------------------------------ joints

    def _joint_name(self, j: int) -> str:
        return self.joint_names[j]

    def _unit(self, j: int) -> float:
        return self.scale if self.model.jnt_type[j] == _SLIDE else 1.0

    def _motion(self, j: int, position: float) -> Array:
        """The pose (7,) that a joint adds after its body's rest frame; lengths in `position` are the file's."""
        axis, anchor = np.asarray(self.model.jnt_axis[j]), np.asarray(self.model.jnt_pos[j]) * self.scale
        if self.model.jnt_type[j] == _SLIDE:
            return np.array([*(axis * position * self.scale), 0.0, 0.0, 0.0, 1.0])
        turn = P.from_axis_angle(axis, np.array(position))
        return np.concatenate([anchor - P.rotate(turn, anchor), turn])

    def _joint(self, j: int, body: int) -> Joint:
        model, unit = self.model, self._unit(j)
        dof, name = int(model.jnt_dofadr[j]), self._joint_name(j)
        lower, upper = (float(v) * unit for v in model.jnt_range[j]) if model.jnt_limited[j] else (-inf, inf)
        home = [k for k in range(model.nkey) if model.key(k).name == "home"]
        start = model.key_qpos[home[0]] if home else model.qpos0
        initial = float(start[model.jnt_qposadr[j]]) * unit
        limited, rubs = bool(model.jnt_limited[j]), model.dof_frictionloss[dof] > 0
        limit = constraint_compliance(model.jnt_solref[j], model.jnt_solimp[j], model.jnt_margin[j], unit)
        dry = constraint_compliance(model.dof_solref[dof], model.dof_solimp[dof], unit=unit)
        if not lower <= initial <= upper:
            self._note("repaired", name, f"starts at {initial:g}, outside of [{lower:g}, {upper:g}]; now at the limit")
        return Joint(
            name=name,
            body=body,
            type=JointType.REVOLUTE if model.jnt_type[j] == _HINGE else JointType.PRISMATIC,
            axis=tidy(model.jnt_axis[j]),
            anchor=tidy(np.asarray(model.jnt_pos[j]) * self.scale),
            lower=lower,
            upper=upper,
            effort_limit=float(np.abs(model.jnt_actfrcrange[j]).max()) if model.jnt_actfrclimited[j] else inf,
            damping=float(model.dof_damping[dof]),
            friction=float(model.dof_frictionloss[dof]),
            armature=float(model.dof_armature[dof]),
            initial=min(max(initial, lower), upper),
            limit_softness=softness(model.jnt_solref[j]),
            stiffness=float(model.jnt_stiffness[j]),
            spring_rest=float(model.qpos_spring[model.jnt_qposadr[j]]) * unit if model.jnt_stiffness[j] else 0.0,
            limit_compliance=limit if limited else None,
            friction_compliance=dry if rubs else None,
        )

    def _couplings(self) -> Couplings:
        """Tendons and constraints; joints that follow others are told so."""
        floating = self.bodies[0].kind is BodyKind.FREE
        origin = _IDENTITY if floating or self.model.body_jntnum[self.top] else P.inverse(self._rest(self.top))
        couplings = Couplings(self.model, self.scale, self.number, self._unit, self.frames, floating, origin)
        try:
            for follower, mimic, tie in couplings.following():
                start = mimic.position(self.joints[mimic.joint].initial)
                joint = self.joints[follower]
                self.joints[follower] = replace(joint, mimic=mimic, initial=start, mimic_compliance=tie)
        except AssetError as error:
            raise AssetError(f"{self.path}: {error}") from None
        for e in range(self.model.neq):
            if self.model.eq_active0[e] and self.model.eq_type[e] == mujoco.mjtEq.mjEQ_TENDON:
                if why := couplings.untied(e):
                    self._note("dropped", f"equality '{self.model.eq(e).name or e}'", f"{why}, and is left out")
        return couplings

    # ------------------------------------------------------------------ drives

    def _hints(self, couplings: Couplings) -> tuple[ActuatorHint, ...]:
        model, hints = self.model, []
        tendon = model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON
        for a in sorted(range(model.nu), key=lambda a: bool(tendon[a])):  # joints that a drive has alone come first
            hint, why = drive_hint(model, a, self.number, self._unit, couplings, {one.joint for one in hints})
            if hint is not None:
                hints.append(hint)
            for text in (why,) if hint is None else left_out(model, a, hint):
                self._note("dropped", f"actuator '{model.actuator(a).name or a}'", text)
        for joint in shared(hints):
            self._note("dropped", self.joints[joint].name, "has several drives in its file; none of them is used")
        return tuple(hints)

    def _note(self, kind: Literal["repaired", "dropped", "info"], where: str, message: str) -> None:
        self.notes.append(ImportNote(kind, where, message))


def _named(names: list[str], kind: str) -> list[str]:
    """The names, and `body3` or the like for those without one, which no other has."""
    return [name or _free(f"{kind}{i}", names) for i, name in enumerate(names)]


def _free(name: str, taken: Collection[str]) -> str:
    """The name, or the first of `name_1`, `name_2`, … that is not taken."""
    count, free = 0, name
    while free in taken:
        count += 1
        free = f"{name}_{count}"
    return free


def _share_of(whole: Inertial) -> float:
    """The share of a body that each of its extra links gets."""
    least = float(inertia.principal(whole.inertia)[0].min()) if whole.mass > 0 else 0.0
    return min(1e-3, max(JOINT_SHARE, _LIGHTEST / least)) if least > 0 else JOINT_SHARE
