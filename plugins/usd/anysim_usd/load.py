"""The importer of USD files: one tree of rigid bodies of a stage, as the parts of a World.

Rules where a stage leaves room or is wrong; each use is a note in the report:
- A root stands still where a fixed joint ties it to the world, else it floats. What a hinge or slide ties to the world
  gets a fixed base at the stage's origin. Without any rigid body, the shapes of the file are one thing that stands.
- What fixed joints join is lumped; the frame survives as a site, the inertia is composed exactly.
- Where the frames of a joint and the places of its bodies differ, those of the joint hold; a difference along the joint
  is where it is at first.
- An inertia that no body can have becomes the nearest possible one. A body without mass that carries others is a
  virtual one, with a share of `VIRTUAL_SHARE`; one that carries nothing is joined rigidly.
- In a stage with y up, the root's frame has z up; all other bodies keep their own.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from anysim.assets.meshes import VISUAL_ERROR
from anysim.assets.model import ActuatorHint, ImportedModel, ImportNote
from anysim.assets.scene import PART
from anysim.conventions import Array
from anysim.errors import AssetError
from anysim.kinematics import inertia
from anysim.kinematics.inertia import VIRTUAL_SHARE
from anysim.math import pose as P
from anysim.model.hash import split, tidy
from anysim.model.world import FAR, Body, BodyKind, Inertial, Joint, JointType, Mimic, Site
from anysim_usd.actuators import actuators
from anysim_usd.files import opened
from anysim_usd.joints import JointReader, Motion, along, moved
from anysim_usd.looks import LookReader
from anysim_usd.mass import MassReader
from anysim_usd.numbers import applied, get, given
from anysim_usd.pairs import excluded_pairs
from anysim_usd.shapes import KINDS, ShapeReader, collides
from anysim_usd.space import IDENTITY, Space
from anysim_usd.structure import BASE, Structure, Tie, Tree
from anysim_usd.unheld import notes_of

_APART = 1e-4
"""[m] and [rad] that places of bodies may differ from what their joint says before a note tells of it."""


_LEADERS = {"newton:mimicJoint": "newton:mimicC", "mjc:target": "mjc:c"}
"""Relations to a joint that is followed, and what the names of their coefficients begin with."""


def import_usd(
    path: Path, *, root: Path, scale: float = 1.0, visual_error: float = VISUAL_ERROR, body: str = ""
) -> ImportedModel:
    """Read one tree of bodies of a USD file; see `anysim.assets.model.Importer` for the arguments.

    `body` is the name of a tree, of its root, or the path of either without the first slash; `/` alone is all that
    stands still.

    Raises:
        AssetError: usd-core is not installed, a missing or damaged file, a reference that leaves `root`, several trees
            and none is named, a closed loop, something the neutral model cannot say.
    """
    notes: list[ImportNote] = []
    with opened(path, root) as (stage, told):
        space = Space(stage, path, scale, notes)
        structure = Structure(stage, path, space, notes)
        still = body == PART
        tree = None if still else structure.chosen(body.removeprefix(PART))
        model = _UsdImport(structure, tree, path, visual_error, notes, alone=not body).run()
    if body.startswith(PART):
        model = _unqualified(model, model.name)
    late = [ImportNote("dropped", "stage", line) for line in told]
    return replace(model, report=(*model.report, *late))


def _unqualified(model: ImportedModel, name: str) -> ImportedModel:
    """A part of a scene whose root is called as the part is: its body is the part, and has no name in it."""
    if model.bodies[0].name != name:
        return model
    links = {"" if link == name else link: body for link, body in model.links.items()}
    geom_links = tuple("" if link == name else link for link in model.geom_links)
    return replace(
        model, bodies=(replace(model.bodies[0], name=""), *model.bodies[1:]), links=links, geom_links=geom_links
    )


class _UsdImport:
    """One import of one tree, or where there is none of what stands still."""

    def __init__(
        self,
        structure: Structure,
        tree: Tree | None,
        path: Path,
        visual_error: float,
        notes: list[ImportNote],
        *,
        alone: bool,
    ) -> None:
        self.structure, self.tree, self.path, self.notes, self.alone = structure, tree, path, notes, alone
        self.space = structure.space
        self.looks = LookReader(self.space, notes)
        self.shapes = ShapeReader(path, self.space, self.looks, visual_error, notes)
        self.masses = MassReader(self.space, self.shapes, self.looks, notes)
        self.reader = JointReader(self.space, notes)
        self.bodies: list[Body] = []
        self.inertials: list[list[Inertial]] = []
        self.joints: list[Joint] = []
        self.sites: list[Site] = []
        self.links: dict[str, int] = {}
        self.hints: list[ActuatorHint] = []
        self.place: dict[str, tuple[int, Array]] = {}  # of each part its body, and where it is in that
        self.carrier: dict[str, tuple[int, Array]] = {}  # of parts with several joints the last link before them
        self.number: dict[str, int] = {}  # of each joint of one direction, by its path
        self.ties: list[Tie] = []
        self.content: dict[str, list[Any]] = {}
        for prim in structure.prims:
            self.content.setdefault(structure.owner[str(prim.GetPath())], []).append(prim)

    def run(self) -> ImportedModel:
        tree = self.tree
        if tree is None:
            name = self._stands_still()
        else:
            name = tree.name
            self._root(tree)
            for part in tree.parts[1:]:
                self._attach(part, self._after_another(part, tree.ties[part]))
        self._frames()
        self._follow()
        self._inertials()
        numbers = {
            path: (number, self.joints[number].type is JointType.REVOLUTE) for path, number in self.number.items()
        }
        taken = {hint.joint for hint in self.hints}
        self.hints += actuators(self.structure, numbers, taken, self.space, self.notes)
        if tree is not None and self.alone and tree.root != BASE:
            self._beside()
        report = [*self.notes, *notes_of(self.structure, self._mine(), self.looks.materials, whole=self.alone)]
        moving = {part: body for part, (body, _) in self.place.items()}
        excluded, further = excluded_pairs(self.structure, moving, self._collides(), self.bodies)
        return ImportedModel(
            name=name,
            bodies=tuple(self.bodies),
            joints=tuple(self.joints),
            geoms=tuple(self.shapes.geoms),
            geom_links=tuple(self.shapes.geom_links),
            sites=tuple(self.sites),
            meshes=tuple(self.shapes.meshes.values()),
            wholes=self.shapes.wholes,
            links=self.links,
            actuator_hints=tuple(self.hints),
            excluded_pairs=excluded,
            report=(*report, *further),
        )

    def _note(self, kind: Any, where: str, message: str) -> None:
        self.notes.append(ImportNote(kind, where, message))

    # ------------------------------------------------------------------ the tree

    def _stands_still(self) -> str:
        """A thing of all shapes that no body moves."""
        prims = [prim for prim in self.content.get(BASE, []) if str(prim.GetTypeName()) in KINDS]
        if not prims:
            raise AssetError(f"{self.path}: holds no rigid body and no shape")
        default = self.structure.stage.GetDefaultPrim()
        name = default.GetName() if default and self.alone else "surroundings"
        self._add(name, Body(name, BodyKind.STATIC))
        self._read(BASE, name, 0, IDENTITY)
        return name

    def _root(self, tree: Tree) -> None:
        if tree.root == BASE:
            taken = {part.name for part in self.structure.parts.values()}
            name = next(name for name in ("base", *(f"base_{i}" for i in range(len(taken)))) if name not in taken)
            self._note(
                "info", f"tree '{tree.name}'", "moves against the world; it gets a fixed base at the stage's origin"
            )
            self._add(name, Body(name, BodyKind.STATIC))
            self.place[BASE] = 0, IDENTITY
            return
        part = self.structure.parts[tree.root]
        frame = self.structure.root_frame(tree)
        kind = BodyKind.STATIC if tree.fixed else BodyKind.FREE
        damping = (0.0, 0.0)
        if kind is BodyKind.FREE and len(tree.parts) == 1:
            linear, angular = (given(part.prim, f"physxRigidBody:{way}Damping") or 0.0 for way in ("linear", "angular"))
            damping = (max(0.0, linear), max(0.0, angular))
        self._add(part.name, Body(part.name, kind, gravity_compensation=self._weightless(part.path), damping=damping))
        self._put(tree.root, 0, P.compose(P.inverse(frame), part.frame), frame)

    def _weightless(self, part: str) -> bool:
        return bool(get(self.structure.parts[part].prim, "physxRigidBody:disableGravity"))

    def _after_another(self, part: str, tie: Tie) -> Tie:
        """Put the links between a part and what carries it, of which it has several joints; the last of these is left.

        The joints of MuJoCo's bodies turn about anchors of the body at its place at zero, one after another.
        """
        assert self.tree is not None
        further = self.tree.further.get(part, [])
        if not further:
            return tie
        body, frame = self.place[tie.ends[0]]
        rest = P.compose(tie.frames[0], P.inverse(tie.frames[1]))
        for other in further:
            there = P.compose(other.frames[0], P.inverse(other.frames[1]))
            gap = P.compose(P.inverse(rest), there)
            if max(np.linalg.norm(gap[:3]), np.linalg.norm(P.rotation_vector(gap[3:]))) > 10 * _APART:
                raise AssetError(
                    f"{self.path}: joint '{other.name}' closes a loop with '{tie.name}', which is not supported"
                )
        for one in (tie, *further[:-1]):
            self.ties.append(one)
            motions = self._ways(self.reader.motions(one), self._forward(one, part))
            if len(motions) != 1:
                raise AssetError(
                    f"{self.path}: joint '{one.name}' is one of several of a body, and has several directions"
                )
            name = f"{self.structure.parts[part].name}.{one.name}"
            second = one.frames[1]
            motion, position = motions[0], self._within(one, motions[0], self.reader.start(one, motions[0], IDENTITY))
            body = self._add(name, Body(name, BodyKind.LINK, body, *split(P.compose(frame, rest)), virtual=True))
            self._joint(one.name, body, one, motion, position, P.rotate(second[3:], motion.axis), second[:3])
            frame, rest = IDENTITY, IDENTITY
        last = further[-1]
        self.carrier[part] = body, IDENTITY
        return last._replace(frames=(last.frames[1], last.frames[1]))

    def _forward(self, tie: Tie, part: str) -> bool:
        """Whether the file has a part as the second body of a joint."""
        own = tie.prim.GetRelationship("physics:body1").GetForwardedTargets()
        return bool(own) and self.structure.owner.get(str(own[0]), BASE) == part

    def _attach(self, part: str, tie: Tie) -> None:
        """Put a part onto the body that carries it: rigidly, or through a body for each direction of the joint."""
        body, frame = self.carrier.get(part, self.place[tie.ends[0]])
        first, second = tie.frames
        motions = self.reader.motions(tie)
        self.ties.append(tie)
        forward, start = self._forward(tie, part), self._between(tie) if part not in self.carrier else IDENTITY
        positions = [self._within(tie, m, self.reader.start(tie, m, start)) for m in self._ways(motions, forward)]
        self._fits(tie, motions if forward else self._ways(motions, forward), positions, start)
        if not motions or self._carries_nothing(part):
            held = IDENTITY
            for motion, position in zip(self._ways(motions, forward), positions, strict=True):
                held = P.compose(held, moved(motion, position))
            pose = P.compose(frame, P.compose(P.compose(first, held), P.inverse(second)))
            if motions:
                self._note("dropped", f"joint '{tie.name}'", "moves no mass, so it is frozen")
            elif (rest := self._rest(tie)) is not None:
                pose = P.compose(frame, rest)
            name = self.structure.parts[part].name
            self.sites.append(Site(name, body, *split(pose)))
            self._put(part, body, pose, P.compose(self._world(body), pose))
            return
        self._chain(part, tie, self._ways(motions, forward), positions)

    @staticmethod
    def _ways(motions: list[Motion], forward: bool) -> list[Motion]:
        """The directions as they carry a part: the other way round where the file has it as the first body."""
        if forward:
            return motions
        return [motion._replace(axis=-motion.axis) for motion in reversed(motions)]

    def _chain(self, part: str, tie: Tie, motions: list[Motion], positions: list[float]) -> None:
        body, frame = self.carrier.get(part, self.place[tie.ends[0]])
        first, second = tie.frames
        name = self.structure.parts[part].name
        pose = P.compose(frame, first)
        for i, (motion, position) in enumerate(zip(motions, positions, strict=True)):
            last = i == len(motions) - 1
            joint = f"{tie.name}.{motion.suffix}" if motion.suffix else tie.name
            axis, anchor = motion.axis, np.zeros(3)
            if last:
                axis, anchor = P.rotate(second[3:], axis), second[:3]
                pose = P.compose(pose, P.inverse(second))
                if len(motions) == 1 and part not in self.carrier:
                    pose, axis, anchor = self._exactly(tie, frame, pose, axis, anchor)
            number = self._add(
                name if last else joint,
                Body(name if last else joint, BodyKind.LINK, body, *split(pose), virtual=not last),
            )
            if last:
                self.bodies[number] = replace(self.bodies[number], gravity_compensation=self._weightless(part))
            self._joint(joint, number, tie, motion, position, axis, anchor)
            body, pose = number, IDENTITY
        self._put(part, body, IDENTITY, self._world(body))

    def _exactly(self, tie: Tie, frame: Array, pose: Array, axis: Array, anchor: Array) -> tuple[Array, Array, Array]:
        """Rest, axis and anchor in double precision, where the file has them so."""
        rest = self._rest(tie)
        pose = pose if rest is None else P.compose(frame, rest)
        for name, rough in (("axis", axis), ("anchor", anchor)):
            value = get(tie.prim, f"anysim:{name}")
            unit = self.space.metres if name == "anchor" else 1.0
            if value is None or not np.allclose(np.array(value) * unit, rough, rtol=1e-5, atol=2e-6):
                continue
            if name == "axis":
                axis = np.array(value, dtype=float)
            else:
                anchor = np.array(value, dtype=float) * unit
        return pose, axis, anchor

    def _rest(self, tie: Tie) -> Array | None:
        """Where the carried part is in what carries it at zero (7,), in double precision where the file says so."""
        value = get(tie.prim, "anysim:rest")
        if value is None or len(value) != 7:
            return None
        exact = np.array([float(v) for v in value])
        exact[:3] *= self.space.metres
        rough = P.compose(tie.frames[0], P.inverse(tie.frames[1]))
        if P.dot(exact[3:], rough[3:]) < 0:
            rough[3:] *= -1
        return exact if np.allclose(exact, rough, rtol=1e-5, atol=2e-6) else None

    def _add(self, name: str, body: Body) -> int:
        if name in self.links or any(other.name == name for other in self.bodies):
            raise AssetError(f"{self.path}: two parts have the name '{name}'; names must be unique")
        self.bodies.append(body)
        self.inertials.append([])
        return len(self.bodies) - 1

    def _put(self, part: str, body: int, pose: Array, world: Array) -> None:
        """A part is at a pose (7,) in a body, which is where its shapes and its mass go."""
        self.place[part] = body, pose
        one = self.structure.parts[part]
        self.links[one.name] = body
        colliders = [prim for prim in self.content.get(part, ()) if collides(prim)]
        own = self.masses.of(one.prim, one.name, one.frame, colliders)
        if own.mass > 0:
            if not inertia.pointlike(own):
                own, text = inertia.repaired(own)
                if text is not None:
                    self._note("repaired", f"body '{one.name}'", text)
            self.inertials[body].append(inertia.moved(own, pose))
        self._read(part, one.name, body, P.compose(one.frame, P.inverse(pose)))

    def _read(self, part: str, name: str, body: int, frame: Array) -> None:
        prims = [prim for prim in self.content.get(part, []) if str(prim.GetTypeName()) in KINDS]
        self.links.setdefault(name, body)
        self.shapes.read(prims, name, body, frame)

    def _world(self, body: int) -> Array:
        """Where a body's frame is (7,) in the model's root, all joints at zero."""
        pose, at = IDENTITY, self.bodies[body]
        while at.parent >= 0:
            pose = P.compose(P.pose(at.position, at.quaternion), pose)
            at = self.bodies[at.parent]
        return pose

    def _carries_nothing(self, part: str) -> bool:
        """Whether neither a part nor what it carries has a mass."""
        assert self.tree is not None
        below = {part}
        for other in self.tree.parts:
            if other in self.tree.ties and self.tree.ties[other].ends[0] in below:
                below.add(other)
        for one in below:
            colliders = [prim for prim in self.content.get(one, ()) if collides(prim)]
            prim = self.structure.parts[one].prim
            if colliders or given(prim, "physics:mass") or given(prim, "anysim:mass"):
                return False
        return True

    # ------------------------------------------------------------------ joints

    def _between(self, tie: Tie) -> Array:
        """A joint's second frame in its first (7,), as the bodies stand in the file."""
        ends = [IDENTITY if end == BASE else self.structure.parts[end].frame for end in tie.ends]
        here, there = (P.compose(end, frame) for end, frame in zip(ends, tie.frames, strict=True))
        return P.compose(P.inverse(here), there)

    def _fits(self, tie: Tie, motions: list[Motion], positions: list[float], start: Array) -> None:
        held = IDENTITY
        for motion in motions:
            held = P.compose(held, moved(motion, along(motion, start) if len(motions) == 1 else 0.0))
        if len(motions) > 1:
            return
        rest = P.compose(P.inverse(held), start)
        distance, turn = float(np.linalg.norm(rest[:3])), float(np.linalg.norm(P.rotation_vector(rest[3:])))
        if distance > _APART or turn > _APART:
            far = f"{distance * 1000:.3g} mm and {turn:.3g} rad"
            self._note("info", f"joint '{tie.name}'", f"its bodies stand {far} beside it in the file; the joint holds")

    def _within(self, tie: Tie, motion: Motion, position: float) -> float:
        position = round(position, 12) + 0.0
        inside = min(max(position, motion.lower), motion.upper)
        if abs(inside - position) > 1e-6 and abs(position) > 1e-4:
            ends = f"[{motion.lower:g}, {motion.upper:g}]"
            self._note(
                "repaired", f"joint '{tie.name}'", f"starts at {position:g}, outside of {ends}; now at the limit"
            )
        return inside if abs(inside) > 1e-7 else min(max(0.0, motion.lower), motion.upper)

    def _joint(
        self, name: str, body: int, tie: Tie, motion: Motion, position: float, axis: Array, anchor: Array
    ) -> None:
        lower, upper = (end if abs(end) < FAR else inf * np.sign(end) for end in (motion.lower, motion.upper))
        number = len(self.joints)
        made = Joint(
            name=name,
            body=body,
            type=JointType.REVOLUTE if motion.turns else JointType.PRISMATIC,
            axis=tidy(axis),
            anchor=tidy(anchor),
            lower=float(lower),
            upper=float(upper),
            initial=position,
        )
        made = replace(made, **self.reader.passive(tie, motion))
        for key in ("damping", "friction", "armature", "stiffness"):
            if getattr(made, key) < 0:
                self._note("repaired", f"joint '{name}'", f"has a {key} of {getattr(made, key):g}, now 0")
                made = replace(made, **{key: 0.0})
        self.joints.append(made)
        if not motion.suffix:
            self.number[tie.path] = number
        hint = self.reader.hint(tie, motion, number)
        if hint is not None:
            self.hints.append(hint)

    def _follow(self) -> None:
        """Joints that follow others, as PhysX and Newton have it, and as anysim writes it."""
        for tie in self.ties:
            if tie.path in self.number and (found := self._leader(tie)) is not None:
                leader, multiplier, offset = found
                number = self.number[tie.path]
                if leader not in self.number or self.number[leader] == number:
                    self._note(
                        "dropped", f"joint '{tie.name}'", f"follows '{leader}', which is no joint that moves here"
                    )
                    continue
                mimic = Mimic(self.number[leader], multiplier, offset)
                start = mimic.position(self.joints[mimic.joint].initial)
                self.joints[number] = replace(self.joints[number], mimic=mimic, initial=start)

    def _leader(self, tie: Tie) -> tuple[str, float, float] | None:
        """The path of the joint that one follows, with multiplier and offset [rad or m]."""
        prim, joint = tie.prim, self.joints[self.number[tie.path]]
        unit = np.radians(1.0) if joint.type is JointType.REVOLUTE else self.space.metres
        relations = {str(one.GetName()): one for one in prim.GetRelationships()}
        for name, relation in relations.items():
            if not (name.startswith("physxMimicJoint:") and name.endswith(":referenceJoint")) and name not in _LEADERS:
                continue
            targets = relation.GetForwardedTargets()
            if len(targets) != 1:
                self._note(
                    "dropped", f"joint '{tie.name}'", f"follows {len(targets)} joints by '{name}'; it follows none here"
                )
                return None
            leader = str(targets[0])
            if name in _LEADERS:
                base, way = _LEADERS[name], 1.0 if name == "newton:mimicJoint" else 1.0 / unit
                ratio, offset = given(prim, f"{base}oef1"), (given(prim, f"{base}oef0") or 0.0) * way
                multiplier = 1.0 if ratio is None else ratio
            else:
                base = name.removesuffix("referenceJoint")
                multiplier, offset = -(given(prim, f"{base}gearing") or 0.0), -(given(prim, f"{base}offset") or 0.0)
            other = self.joints[self.number[leader]] if leader in self.number else joint
            if joint.type is not other.type:
                their = np.radians(1.0) if other.type is JointType.REVOLUTE else self.space.metres
                multiplier *= unit / their
            return leader, *self._exact_mimic(prim, multiplier, offset * unit, unit)
        return None

    def _exact_mimic(self, prim: Any, multiplier: float, offset: float, unit: float) -> tuple[float, float]:
        value = get(prim, "anysim:mimic")
        if value is None:
            return float(multiplier), float(offset)
        exact = np.array([float(v) for v in value])
        close = np.allclose(exact, [multiplier, offset], rtol=2e-6, atol=2e-6 * max(1.0, abs(unit)))
        return (float(exact[0]), float(exact[1])) if close else (float(multiplier), float(offset))

    # ------------------------------------------------------------------ what remains

    def _inertials(self) -> None:
        totals = [inertia.composed([part for part in parts if part.mass > 0]) for parts in self.inertials]
        carried: list[list[Inertial]] = [[] for _ in self.bodies]
        for i in reversed(range(1, len(self.bodies))):
            body, served = self.bodies[i], totals[i]
            if served.mass <= 0:
                served = inertia.composed(carried[i])
                totals[i] = inertia.scaled(served, VIRTUAL_SHARE)
                text = f"moves without mass; now {totals[i].mass:.3g} kg, {VIRTUAL_SHARE:g} of what it carries"
                self._note("repaired", f"body '{body.name}'", text)
            carried[body.parent].append(inertia.moved(served, P.pose(body.position, body.quaternion)))
        for i, body in enumerate(self.bodies):
            total = totals[i]
            if body.kind is not BodyKind.STATIC and total.mass > 0:
                total, text = inertia.repaired(total)
                if text is not None:
                    self._note("repaired", f"body '{body.name}'", text)
                total = inertia.moving(total)
            self.bodies[i] = replace(body, inertial=total)

    def _frames(self) -> None:
        """Sites: prims that MuJoCo or Newton call so."""
        taken = {body.name for body in self.bodies} | {site.name for site in self.sites}
        for part, (body, pose) in self.place.items():
            for prim in self.content.get(part, ()):
                if not {"MjcSiteAPI", "NewtonSiteAPI"} & set(applied(prim)):
                    continue
                base = IDENTITY if part == BASE else self.structure.parts[part].frame
                at = P.compose(pose, P.compose(P.inverse(base), self.space.of(prim).pose))
                rest = get(prim, "anysim:frame")
                if rest is not None and np.allclose(np.array(rest)[:3] * self.space.metres, at[:3], atol=1e-5):
                    at = np.array([float(v) for v in rest])
                    at[:3] *= self.space.metres
                name = str(get(prim, "anysim:name") or prim.GetName())
                free = name if name not in taken else f"{self.bodies[body].name}.{name}"
                if free != name:
                    self._note("info", f"frame '{name}'", f"is found as '{free}': another has its name")
                taken.add(free)
                self.sites.append(Site(free, body, *split(at)))

    def _beside(self) -> None:
        """Say what of a file with one tree stands around it."""
        around = [prim for prim in self.content.get(BASE, ()) if str(prim.GetTypeName()) in KINDS]
        if around:
            text = f"{len(around)} shapes of the world beside the model are left out; `world.source` reads them"
            self._note("dropped", "stage", text)

    def _mine(self) -> Iterator[Any]:
        """The prims that this model is made of."""
        parts = set(self.place) if self.tree is not None else {BASE}
        if self.tree is not None and BASE in parts:
            parts.discard(BASE)
        for part in parts:
            shapes_alone = part == BASE  # the scene's reader tells of the rest
            for prim in self.content.get(part, ()):
                if not shapes_alone or str(prim.GetTypeName()) in (*KINDS, "GeomSubset"):
                    yield prim
        yield from (tie.prim for tie in self.ties)

    def _collides(self) -> dict[str, list[Any]]:
        """Of each part the prims that are touched."""
        return {part: [prim for prim in self.content.get(part, ()) if collides(prim)] for part in self.place}
