"""One model fixed to a link of another: a gripper on an arm, an arm on a base. Both become one kinematic tree.

The part's root is lumped into the body that carries it, as an importer lumps what a source joins rigidly; the frame of
the root survives as a site. The part's other bodies follow the last descendant of that body, so that the order stays
depth first.
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import TypeVar

import numpy as np

from anysim.assets.model import ActuatorHint, ImportedModel, ImportNote
from anysim.conventions import IDENTITY_QUATERNION, Array
from anysim.errors import AssetError, listing, suggest
from anysim.kinematics import inertia
from anysim.math import pose as P
from anysim.model.hash import split
from anysim.model.world import (
    ORIGIN,
    Body,
    Constraint,
    Geom,
    HeightFieldShape,
    Joint,
    MeshShape,
    Quat,
    Site,
    SpatialTendon,
    Vec3,
    Waypoint,
)

_IDENTITY = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
_GeomOrSite = TypeVar("_GeomOrSite", Geom, Site)


def attach(model: ImportedModel, part: ImportedModel, link: str, pose: Array, prefix: str = "") -> ImportedModel:
    """The model with a part fixed to one of its links.

    Args:
        model: what carries the part. Its own bodies keep their order and its names stay.
        part: what is fixed to it; it may have joints, which keep their order behind those of the carrying branch.
        link: the link (or named frame) of `model` that carries it.
        pose: of the part's root in that link's frame (7,) [m, xyzw].
        prefix: put before all names of the part.

    Raises:
        AssetError: there is no such link, or a name of the part is taken.
    """
    return _Attachment(model, part, prefix).joined(link, pose)


class _Attachment:
    """Where the bodies and joints of both models go."""

    def __init__(self, model: ImportedModel, part: ImportedModel, prefix: str) -> None:
        self.model, self.part, self.prefix = model, part, prefix

    def joined(self, link: str, pose: Array) -> ImportedModel:
        self.carrier, frame = self._frame(link)
        self.frame = P.compose(frame, pose)
        self._check_names()
        self.stop = self._subtree_end(self.carrier)
        more = len(self.part.bodies) - 1
        self.body = [i if i < self.stop else i + more for i in range(len(self.model.bodies))]
        self.joint = [i if i < self.stop - 1 else i + more for i in range(len(self.model.joints))]
        self.part_body = [self.carrier, *range(self.stop, self.stop + more)]
        self.part_joint = [self.stop - 1 + i for i in range(more)]
        model, part = self.model, self.part
        geoms, links = self._geoms()
        root = Site(self._named(part.bodies[0].name), self.carrier, *split(self.frame))
        sites = [replace(s, body=_at(self.body, s.body)) for s in model.sites]
        sites += [root, *(self._placed(s) for s in part.sites)]
        return replace(
            model,
            bodies=tuple(self._bodies()),
            joints=tuple(self._joints()),
            geoms=tuple(geoms),
            geom_links=tuple(links),
            sites=tuple(sites),
            meshes=(*model.meshes, *self.meshes),
            heightfields=(*model.heightfields, *(replace(f, name=self._named(f.name)) for f in part.heightfields)),
            textures=(*model.textures, *part.textures),
            materials=(*model.materials, *part.materials),
            links={k: _at(self.body, b) for k, b in model.links.items()}
            | {self._named(k): self.part_body[b] for k, b in part.links.items()},
            actuator_hints=(*_hints(model.actuator_hints, self.joint), *_hints(part.actuator_hints, self.part_joint)),
            tendons=(
                *(t.renumbered(self.joint.__getitem__) for t in model.tendons),
                *(t.renumbered(self.part_joint.__getitem__, self.prefix) for t in part.tendons),
            ),
            spatial_tendons=(
                *(t.renumbered(self.body.__getitem__) for t in model.spatial_tendons),
                *map(self._strung, part.spatial_tendons),
            ),
            constraints=(
                *(c.renumbered(self.body.__getitem__) for c in model.constraints),
                *map(self._held, part.constraints),
            ),
            excluded_pairs=_pairs(model.excluded_pairs, self.body) | _pairs(part.excluded_pairs, self.part_body),
            report=(*model.report, *part.report, *self._spread()),
        )

    def _spread(self) -> list[ImportNote]:
        """Bodies that pass through one of the two that become one, and now through both."""
        ends = ((self.model, self.carrier, self.part, 0), (self.part, 0, self.model, self.carrier))
        return [
            ImportNote("dropped", other.bodies[there].name, f"passes through what '{own.bodies[here].name}' does")
            for own, here, other, there in ends
            if any(here in pair for pair in own.excluded_pairs)
            and any(geom.body == there and geom.collides for geom in other.geoms)
        ]

    def _frame(self, link: str) -> tuple[int, Array]:
        """The body that carries a link or frame, and where that is in the body."""
        frames = self.model.frames
        if link in frames:
            found = frames[link]
            return found.body, P.pose(found.position, found.quaternion)
        known = f"{suggest(link, list(frames))} (links: {listing(frames, 20)})"
        raise AssetError(f"'{self.model.name}' has no link '{link}' to carry '{self.part.name}'{known}")

    def _check_names(self) -> None:
        for what, theirs, ours in (
            ("link", _frames(self.model), _frames(self.part)),
            ("joint", [j.name for j in self.model.joints], [j.name for j in self.part.joints]),
            ("geom", [g.name for g in self.model.geoms], [g.name for g in self.part.geoms]),
        ):
            taken = sorted({self._named(name) for name in ours if name} & set(theirs))
            if taken:
                raise AssetError(
                    f"'{self.model.name}' has the {what}s {listing(taken, 6)} already, which '{self.part.name}' brings "
                    f"too; give the part {'a' if not self.prefix else 'another'} `prefix`, as 'tool_'"
                )

    def _named(self, name: str) -> str:
        return f"{self.prefix}{name}" if name else ""

    def _subtree_end(self, body: int) -> int:
        """One past the last descendant of a body: bodies are depth first."""
        parents = [b.parent for b in self.model.bodies]
        stop = body + 1
        while stop < len(parents) and parents[stop] >= body:
            stop += 1
        return stop

    def _bodies(self) -> list[Body]:
        own = [replace(b, parent=_at(self.body, b.parent)) for b in self.model.bodies]
        moved = inertia.moved(self.part.bodies[0].inertial, self.frame)
        parts = [one for one in (own[self.carrier].inertial, moved) if one.mass > 0]
        own[self.carrier] = replace(own[self.carrier], inertial=inertia.composed(parts))
        brought = []
        for body in self.part.bodies[1:]:
            rest = P.pose(body.position, body.quaternion)
            placed = split(P.compose(self.frame, rest)) if body.parent == 0 else (body.position, body.quaternion)
            brought.append(
                replace(
                    body,
                    name=self._named(body.name),
                    parent=self.part_body[body.parent],
                    position=placed[0],
                    quaternion=placed[1],
                )
            )
        return [*own[: self.stop], *brought, *own[self.stop :]]

    def _joints(self) -> list[Joint]:
        own = [_renumbered(j, self.body, self.joint) for j in self.model.joints]
        brought = [
            replace(_renumbered(j, self.part_body, self.part_joint), name=self._named(j.name)) for j in self.part.joints
        ]
        return [*own[: self.stop - 1], *brought, *own[self.stop - 1 :]]

    def _geoms(self) -> tuple[list[Geom], list[str]]:
        """Geoms with the links they were on; fills `meshes`, those that the part adds."""
        own = {mesh.name: mesh.hash for mesh in self.model.meshes}
        renamed: dict[str, str] = {}
        self.meshes = []
        for mesh in self.part.meshes:
            if own.get(mesh.name, mesh.hash) != mesh.hash:
                renamed[mesh.name] = f"{mesh.name}_{mesh.hash[:8]}"
                self.meshes.append(replace(mesh, name=renamed[mesh.name]))
            elif mesh.name not in own:
                self.meshes.append(mesh)
        geoms = [replace(g, body=_at(self.body, g.body)) for g in self.model.geoms]
        for geom in self.part.geoms:
            shape = geom.shape
            if isinstance(shape, MeshShape):
                shape = replace(shape, mesh=renamed.get(shape.mesh, shape.mesh))
            elif isinstance(shape, HeightFieldShape):
                shape = HeightFieldShape(self._named(shape.heightfield))
            geoms.append(replace(self._placed(geom), shape=shape))
        return geoms, [*self.model.geom_links, *(self._named(name) for name in self.part.geom_links)]

    def _held(self, constraint: Constraint) -> Constraint:
        """A constraint of the part; frames on its root move along with that."""
        first = self._held_end(constraint.body, constraint.position, constraint.quaternion)
        second = self._held_end(constraint.other, constraint.other_position, constraint.other_quaternion)
        return replace(
            constraint,
            name=self._named(constraint.name),
            **dict(zip(("body", "position", "quaternion"), first, strict=True)),
            **dict(zip(("other", "other_position", "other_quaternion"), second, strict=True)),
        )

    def _held_end(self, body: int, position: Vec3, quaternion: Quat) -> tuple[int, Vec3, Quat]:
        if body <= 0:
            return self.carrier, *split(P.compose(self.frame, P.pose(position, quaternion)))
        return self.part_body[body], position, quaternion

    def _strung(self, tendon: SpatialTendon) -> SpatialTendon:
        """A spatial tendon of the part; what it runs through on its root moves along with that."""
        path: list[Waypoint] = []
        for point in tendon.path:
            wrap = point.wrap
            turn = IDENTITY_QUATERNION if wrap is None else wrap.quaternion
            body, position, turn = self._held_end(point.body, point.position, turn)
            if wrap is not None:
                side_body, side, _ = self._held_end(wrap.side_body, wrap.side or ORIGIN, IDENTITY_QUATERNION)
                wrap = wrap._replace(quaternion=turn, side=wrap.side and side, side_body=side_body)
            path.append(Waypoint(body, position, wrap, point.pulley))
        return replace(tendon, name=self._named(tendon.name), path=tuple(path))

    def _placed(self, thing: _GeomOrSite) -> _GeomOrSite:
        """A geom or site of the part; what is on its root moves along with that."""
        pose = P.pose(thing.position, thing.quaternion)
        on_root = thing.body <= 0  # also what the part fixes to the world: the carrier is its world
        position, quaternion = split(P.compose(self.frame, pose) if on_root else pose)
        body = self.carrier if on_root else self.part_body[thing.body]
        return replace(thing, name=self._named(thing.name), body=body, position=position, quaternion=quaternion)


def _at(table: list[int], index: int) -> int:
    """The new number of a body; -1 stays."""
    return index if index < 0 else table[index]


def _frames(model: ImportedModel) -> list[str]:
    return [*model.links, *(b.name for b in model.bodies), *(site.name for site in model.sites)]


def _renumbered(joint: Joint, body: list[int], number: list[int]) -> Joint:
    mimic = None if joint.mimic is None else joint.mimic._replace(joint=number[joint.mimic.joint])
    return replace(joint, body=body[joint.body], mimic=mimic)


def _hints(hints: Iterable[ActuatorHint], number: list[int]) -> list[ActuatorHint]:
    return [hint.renumbered(number.__getitem__) for hint in hints]


def _pairs(pairs: Iterable[tuple[int, int]], body: list[int]) -> frozenset[tuple[int, int]]:
    moved = [(_at(body, low), _at(body, high)) for low, high in pairs]
    return frozenset((min(pair), max(pair)) for pair in moved)
