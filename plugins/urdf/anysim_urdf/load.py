"""The importer of URDF files: from links and joints to the parts of a World.

Rules where a source leaves room or is wrong; each use is a note in the report:
- Fixed joints are lumped into the parent; the frame survives as a site, the inertia is composed exactly.
- An inertia that no body can have becomes the nearest possible one (`anysim.kinematics.inertia.repaired`).
- A revolute joint without limits, or with lower >= upper, is continuous; so is a prismatic one, along its axis. An
  effort or velocity limit of 0 counts as not given.
- A moving link without mass that carries links with mass is a virtual one: it gets a share of `VIRTUAL_SHARE` of their
  mass and inertia. One that carries none
  cannot be simulated: its joint is frozen at zero (or the nearest limit) and it is lumped. A source in which no moving
  link has a mass is refused.
- A joint that follows a follower follows its leader directly; one that follows a frozen joint is frozen too.
- Axes are normalised. A joint of several axes becomes a chain (`anysim_urdf.several_axes`). Unknown joints, several
  roots, loops and duplicate names are refused.
"""

from collections.abc import Mapping
from dataclasses import replace
from math import inf
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from anysim.assets.meshes import VISUAL_ERROR
from anysim.assets.model import ImportedModel, ImportNote
from anysim.conventions import Array
from anysim.errors import AssetError, listing, suggest
from anysim.kinematics import inertia
from anysim.kinematics.inertia import VIRTUAL_SHARE
from anysim.math import matrix as M, pose as P
from anysim.model.hash import split, tidy
from anysim.model.world import FAR, Body, BodyKind, Inertial, Joint, JointType, Mimic, Site
from anysim_urdf.geometry import GeometryReader
from anysim_urdf.several_axes import KINDS, unfolded
from anysim_urdf.xml import InertialElement, JointElement, ModelElements, UrdfFile

_LIMIT_SLACK = 1e-3  # [rad] or [m] that limits of followers and leaders may differ by, from rounding
_TYPES = {"revolute": JointType.REVOLUTE, "continuous": JointType.REVOLUTE, "prismatic": JointType.PRISMATIC}
_IDENTITY = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


def import_urdf(
    path: Path,
    *,
    root: Path,
    scale: float = 1.0,
    packages: Mapping[str, Path] = MappingProxyType({}),
    visual_error: float = VISUAL_ERROR,
) -> ImportedModel:
    """Read a URDF file; see `anysim.assets.model.Importer` for the arguments, `resolve_reference` for `packages`.

    Raises:
        AssetError: a missing or damaged file or mesh, or something the neutral model cannot say.
    """
    return _UrdfImport(UrdfFile(path), root, scale, packages, visual_error).run()


def import_expanded(
    path: Path, expanded: Path, *, root: Path, scale: float, packages: Mapping[str, Path], visual_error: float
) -> ImportedModel:
    """Read `expanded`, a URDF file that was made of `path`, which is what its references are relative to."""
    return _UrdfImport(UrdfFile(path, expanded), root, scale, packages, visual_error).run()


def imported(
    file: ModelElements, *, root: Path, scale: float, packages: Mapping[str, Path], visual_error: float
) -> ImportedModel:
    """The model of links and joints that some reader has found."""
    return _UrdfImport(file, root, scale, packages, visual_error).run()


class _UrdfImport:
    """One import: walks the tree once, depth first, children in source order."""

    def __init__(
        self, file: ModelElements, root: Path, scale: float, packages: Mapping[str, Path], visual_error: float
    ) -> None:
        self.file, self.scale = file, scale
        whole = unfolded(file)
        self.notes: list[ImportNote] = [*file.unheld, *whole.notes]
        self.links, self.elements = whole.links, whole.joints
        self.kind = BodyKind.FREE if whole.floats else BodyKind.STATIC
        self.children: dict[str, list[JointElement]] = {name: [] for name in self.links}
        self.base = self._structure()
        self.geometry = GeometryReader(file, root, scale, packages, visual_error, self.notes)
        self.bodies: list[Body] = []
        self.inertials: list[list[Inertial]] = []
        self.joints: list[Joint] = []
        self.sites: list[Site] = []
        self.place: dict[str, int] = {}

    def run(self) -> ImportedModel:
        self.frozen = self._frozen()
        self._add_body(self.base, Body(self.base, self.kind))
        stack = [(joint, 0, _IDENTITY) for joint in reversed(self.children[self.base])]
        while stack:
            joint, parent, frame = stack.pop()
            rest = P.compose(frame, self._origin(joint))
            if joint.type == "fixed" or joint.name in self.frozen:
                body, here = parent, P.compose(rest, self._frozen_motion(joint))
                self.sites.append(Site(joint.child, body, *split(here)))
                self._add_link(joint.child, body, here)
            else:
                body, here = len(self.bodies), _IDENTITY
                self._add_body(joint.child, Body(joint.child, BodyKind.LINK, parent, *split(rest)))
                self.joints.append(self._joint(joint, body))
            stack += [(child, body, here) for child in reversed(self.children[joint.child])]
        self._mimic()
        self._inertials()
        geometry = self.geometry
        return ImportedModel(
            name=self.file.name,
            bodies=tuple(self.bodies),
            joints=tuple(self.joints),
            geoms=tuple(geometry.geoms),
            geom_links=tuple(geometry.geom_links),
            sites=tuple(self.sites),
            meshes=tuple(geometry.meshes.values()),
            links=self.place,
            report=tuple(self.notes),
            wholes=geometry.wholes,
        )

    # ------------------------------------------------------------------ the tree

    def _structure(self) -> str:
        """Fills `children` and returns the root link."""
        if not self.links:
            raise AssetError(f"{self.file.path}: has no links: {self.file.instead}")
        parent: dict[str, str] = {}
        for joint in self.elements:
            here = self.file.where("joint", joint.name)
            for name in (joint.parent, joint.child):
                if name not in self.links:
                    raise AssetError(f"{here} refers to the link '{name}', which does not exist")
            if joint.child in parent:
                raise AssetError(f"{here}: the link '{joint.child}' has two parents; closed loops are not supported")
            if joint.type != "fixed" and joint.type not in _TYPES:
                raise AssetError(
                    f"{here} is of type '{joint.type}'; known are fixed, {', '.join(_TYPES)}, {', '.join(KINDS)}"
                )
            parent[joint.child] = joint.name
            self.children[joint.parent].append(joint)
        roots = [name for name in self.links if name not in parent]
        if len(roots) != 1:
            which = listing(roots, 6) if roots else "none, the joints form a loop"
            raise AssetError(f"{self.file.path}: a URDF has exactly one root link; this one has {which}")
        reached = 0
        stack = [roots[0]]
        while stack:
            reached += 1
            stack += [joint.child for joint in self.children[stack.pop()]]
        if reached != len(self.links):
            raise AssetError(f"{self.file.path}: {len(self.links) - reached} links form a loop apart from the root")
        return roots[0]

    def _order(self) -> list[str]:
        order, stack = [], [self.base]
        while stack:
            order.append(stack.pop())
            stack += [joint.child for joint in self.children[order[-1]]]
        return order

    def _frozen(self) -> set[str]:
        """Joints that move nothing with mass, and joints that follow one of those."""
        mass: dict[str, float] = {}
        for name in reversed(self._order()):
            own = self.links[name].inertial
            mass[name] = max(0.0, own.mass) if own is not None else 0.0
            mass[name] += sum(mass[joint.child] for joint in self.children[name])
        moving = [joint for joint in self.elements if joint.type != "fixed"]
        frozen = {joint.name for joint in moving if mass[joint.child] <= 0}
        if moving and len(frozen) == len(moving):
            raise AssetError(f"{self.file.path}: no link that moves has a mass; add <inertial> elements to simulate it")
        for name in sorted(frozen):
            joint = next(j for j in moving if j.name == name)
            self._note("dropped", "joint", name, f"moves no mass (link '{joint.child}'), so it is frozen")
        by_name = {joint.name: joint for joint in moving}
        for joint in moving:
            leader, _, _ = self._leader(joint, by_name)
            if leader is not joint and leader.name in frozen and joint.name not in frozen:
                frozen.add(joint.name)
                self._note(
                    "dropped", "joint", joint.name, f"follows '{leader.name}', which is frozen, so it is frozen too"
                )
        return frozen

    def _leader(self, joint: JointElement, by_name: Mapping[str, JointElement]) -> tuple[JointElement, float, float]:
        """The joint at the end of a chain of mimics, with multiplier and offset."""
        multiplier, offset, seen, current = 1.0, 0.0, {joint.name}, joint
        while current.mimic is not None:
            name = current.mimic.joint
            here = self.file.where("joint", joint.name)
            if name in seen:
                raise AssetError(f"{here} follows itself through '{name}'")
            if name not in by_name:
                known = f"{suggest(name, list(by_name))} (joints: {listing(by_name)})"
                raise AssetError(f"{here} follows '{name}', which is no joint that moves{known}")
            offset += multiplier * current.mimic.offset
            multiplier *= current.mimic.multiplier
            seen.add(name)
            current = by_name[name]
        return current, multiplier, offset

    def _mimic(self) -> None:
        by_name = {joint.name: joint for joint in self.elements if joint.type != "fixed"}
        number = {joint.name: i for i, joint in enumerate(self.joints)}
        for i, joint in enumerate(self.joints):
            leader, multiplier, offset = self._leader(by_name[joint.name], by_name)
            if leader.name == joint.name:
                continue
            target = self.joints[number[leader.name]]
            if JointType.PRISMATIC in (joint.type, target.type) and joint.type is not target.type:
                multiplier *= self.scale if joint.type is JointType.PRISMATIC else 1 / self.scale
            if joint.type is JointType.PRISMATIC:
                offset *= self.scale
            mimic = Mimic(number[leader.name], multiplier, offset)
            lower, upper = self._room_to_follow(joint, target, mimic)
            start = multiplier * target.initial + offset
            self.joints[i] = replace(joint, mimic=mimic, initial=start, lower=lower, upper=upper)

    def _room_to_follow(self, joint: Joint, leader: Joint, mimic: Mimic) -> tuple[float, float]:
        """Limits that let a follower go where its leader takes it: narrower ones would lock the leader as well."""
        if not mimic.multiplier:
            return joint.lower, joint.upper
        ends = sorted(mimic.multiplier * end + mimic.offset for end in (leader.lower, leader.upper))
        lower, upper = min(joint.lower, ends[0]), max(joint.upper, ends[1])
        if max(joint.lower - lower, upper - joint.upper) <= _LIMIT_SLACK:
            return joint.lower, joint.upper
        self._note(
            "repaired",
            "joint",
            joint.name,
            f"stops at [{joint.lower:g}, {joint.upper:g}], but follows '{leader.name}' "
            f"from {ends[0]:g} to {ends[1]:g}; now as far as that",
        )
        return lower, upper

    # ------------------------------------------------------------------ joints

    def _origin(self, joint: JointElement) -> Array:
        return np.concatenate([joint.origin[:3] * self.scale, joint.origin[3:]])

    def _axis(self, joint: JointElement) -> Array:
        length = float(np.linalg.norm(joint.axis))
        if not length > 1e-9:
            raise AssetError(f"{self.file.where('joint', joint.name)} has an axis of length {length:g}")
        if abs(length - 1) > 1e-6:
            self._note("repaired", "joint", joint.name, f"has an axis of length {length:g}, now 1")
        return joint.axis / length

    def _limits(self, joint: JointElement) -> tuple[float, float]:
        unit = self.scale if joint.type == "prismatic" else 1.0
        if joint.type == "continuous":
            return -inf, inf
        if joint.lower is None or joint.upper is None:
            self._note("info", "joint", joint.name, "has no limits and moves without end")
            return -inf, inf
        if max(abs(joint.lower), abs(joint.upper)) >= FAR:
            text = f"has limits [{joint.lower:g}, {joint.upper:g}], of which those beyond {FAR:g} are none"
            self._note("repaired", "joint", joint.name, text)
        if joint.lower >= joint.upper:
            text = f"has limits [{joint.lower:g}, {joint.upper:g}], which is read as moving without end"
            self._note("repaired", "joint", joint.name, text)
            return -inf, inf
        return joint.lower * unit, joint.upper * unit

    def _joint(self, joint: JointElement, body: int) -> Joint:
        lower, upper = self._limits(joint)
        return Joint(
            name=joint.name,
            body=body,
            type=_TYPES[joint.type],
            axis=tidy(self._axis(joint)),
            anchor=tidy(np.array(joint.anchor) * self.scale),
            lower=lower,
            upper=upper,
            velocity_limit=_bound(joint.velocity),
            effort_limit=_bound(joint.effort),
            damping=self._positive(joint, "damping"),
            friction=self._positive(joint, "friction"),
            stiffness=self._positive(joint, "stiffness"),
            spring_rest=joint.spring_rest * (self.scale if joint.type == "prismatic" else 1.0),
            initial=min(max(0.0, lower), upper),
        )

    def _positive(self, joint: JointElement, key: str) -> float:
        value: float = getattr(joint, key)
        if value < 0:
            self._note("repaired", "joint", joint.name, f"has a {key} of {value:g}, now 0")
        return max(value, 0.0)

    def _frozen_motion(self, joint: JointElement) -> Array:
        """Where a joint that does not move holds its child, seen from its own rest frame."""
        if joint.type == "fixed":
            return _IDENTITY
        lower, upper = self._limits(joint)
        at = min(max(0.0, lower), upper)
        if joint.type == "prismatic":
            return np.array([*(self._axis(joint) * at), 0.0, 0.0, 0.0, 1.0])
        turn, anchor = P.from_axis_angle(self._axis(joint), np.array(at)), np.array(joint.anchor) * self.scale
        return np.concatenate([anchor - P.rotate(turn, anchor), turn])

    # ------------------------------------------------------------------ links

    def _add_body(self, link: str, body: Body) -> None:
        self.bodies.append(body)
        self.inertials.append([])
        self._add_link(link, len(self.bodies) - 1, _IDENTITY)

    def _add_link(self, name: str, body: int, pose: Array) -> None:
        self.place[name] = body
        link = self.links[name]
        if link.inertial is not None:
            self.inertials[body].append(inertia.moved(self._inertial(name, link.inertial), pose))
        self.geometry.read(link, body, pose)

    def _inertial(self, link: str, own: InertialElement) -> Inertial:
        s = self.scale
        mass = own.mass * s**3
        if mass < 0:
            raise AssetError(f"{self.file.where('link', link)} has a negative mass, {own.mass:g} kg")
        matrix, turn = own.inertia * s**5, P.to_matrix(own.origin[3:])
        raw = inertia.make(mass, own.origin[:3] * s, M.product(turn, matrix, turn.T))
        if mass > 0 and inertia.pointlike(raw):
            return raw  # a point mass, which is fine as a part of a body
        fixed, text = inertia.repaired(raw)
        if text is not None:
            self._note("repaired", "link", link, text)
        return fixed

    def _inertials(self) -> None:
        totals = [inertia.composed([part for part in parts if part.mass > 0]) for parts in self.inertials]
        carried: list[list[Inertial]] = [[] for _ in self.bodies]  # of each, what it moves that has a mass of its own
        for i in reversed(range(1, len(self.bodies))):
            body, served = self.bodies[i], totals[i]
            if served.mass <= 0:
                served = inertia.composed(carried[i])
                totals[i] = inertia.scaled(served, VIRTUAL_SHARE)
                text = f"moves without mass; now {totals[i].mass:.3g} kg, {VIRTUAL_SHARE:g} of what it carries"
                self._note("repaired", "link", body.name, text)
            carried[body.parent].append(inertia.moved(served, P.pose(body.position, body.quaternion)))
        for i, body in enumerate(self.bodies):
            total = totals[i]
            if body.kind is BodyKind.LINK:
                total, text = inertia.repaired(total)
                if text is not None:
                    self._note("repaired", "link", body.name, text)
                total = inertia.moving(total)
            self.bodies[i] = replace(body, inertial=total)

    def _note(self, kind: Any, what: str, name: str, message: str) -> None:
        self.notes.append(ImportNote(kind, self.file.where(what, name), message))


def _bound(value: float | None) -> float:
    return float(value) if value is not None and value > 0 else inf
