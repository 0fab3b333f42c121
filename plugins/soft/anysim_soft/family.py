"""Soft matter as a family: what blocks, ropes and cloth have in common."""

from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.conventions import Array
from anysim.engine.cameras import CameraView
from anysim.errors import SpecError, SpecIssue, listing
from anysim.families.base import Family, FamilyPart, FamilySetting, FamilyState
from anysim.families.cosolver import CoSolver, MetBodies
from anysim.math import pose as P
from anysim.model.world import Body, BodyKind
from anysim.randomization.draw import draw_rows
from anysim.threads import shared
from anysim_schemas.base import Spec
from anysim_soft.pads import Pads
from anysim_soft.spec import MOST, PadSpec, SoftSpec
from anysim_soft.subworld import FlexSource, Joint, ProxyMass, Scenery, SubWorld
from anysim_soft.surfaces import Surfaced

UP = np.array([0.0, 0.0, 1.0])

SHARE = 0.3
"""Of the impulse that is due to a held body it gets this much in a physics step; the rest follows."""


class Soft(CoSolver):
    """V points in each env, which MuJoCo moves in a world of its own; all that it knows is in `memory`.

    Attributes:
        x, v: (N, V, 3) [m], [m/s] the points.
        values: (N, …) the parameters as they are drawn, in the order of `drawn_keys`.
        pending: (N, K, 6) impulses that held bodies will get.
        pads: the hands that hold it.
    """

    drawn = True
    label: ClassVar[str]
    drawn_keys: ClassVar[tuple[str, ...]] = ("drag", "friction")
    meets_surfaces: ClassVar[bool] = False
    """Whether it meets the surfaces of other matter."""

    # ------------------------------------------------------------------ what kinds differ in

    @classmethod
    @abstractmethod
    def count(cls, spec: SoftSpec) -> int:
        """How many points it has."""

    @abstractmethod
    def source(self, values: Mapping[str, float], pose: Array) -> FlexSource:
        """The flex with drawn parameters, its frame at a pose (7,)."""

    def attached_sides(self) -> Sequence[tuple[str, str]]:
        """Which sides of it are held by which bodies."""
        return ()

    @classmethod
    def pads_of(cls, spec: SoftSpec) -> Mapping[str, PadSpec]:
        """The hands that may hold it."""
        del spec
        return {}

    def after_solve(self, env: int, sub: SubWorld) -> None:
        """The solver of an env has moved on."""

    def push_on_nodes(self, env: int) -> Array | None:
        """(V, 3) [N] what other matter does to its nodes in a step; None where there is nothing."""
        del env

    @property
    @abstractmethod
    def radius(self) -> float:
        """[m] of matter around each point."""

    # ------------------------------------------------------------------ the World

    @classmethod
    def parts(cls, name: str, spec: Spec) -> Iterable[FamilyPart]:
        assert isinstance(spec, SoftSpec)
        if (count := cls.count(spec)) > MOST:
            raise SpecError([SpecIssue("", ".points", f"it has {count:,} points; {MOST:,} at most are possible")])
        return [FamilyPart(name, ImportedModel(name, (Body("", BodyKind.STATIC),), links={"": 0}), cls.label)]

    # ------------------------------------------------------------------ made

    def __init__(self, setting: FamilySetting) -> None:
        super().__init__(setting)
        assert isinstance(setting.spec, SoftSpec)
        self.soft = setting.spec
        self.pads = Pads(setting, self.pads_of(setting.spec))
        world, k = setting.engine.world, len(self.met)
        self.scenery = Scenery.of(world, self.met)
        entity = np.array(world.body_entity, dtype=np.intp)
        self._entities = entity[np.concatenate([self.met, self.scenery.still])]
        self._at = None if setting.spec.at is None else self.body(setting.spec.at, "at")
        self._heavier = np.ones(k)
        for name, factor in setting.spec.held.items():
            self._heavier[self._met(name, "held", loose=True)] = factor
        self._late = self._held | (self._heavier > 1.0)
        self._gravity = np.array(world.physics.gravity, dtype=float)
        self._step = world.physics.dt / self.soft.substeps
        self._worlds: dict[int, tuple[bytes, SubWorld]] = {}
        self.under: Sequence[Surfaced] = ()
        self.values = self.remember("values", len(self.drawn_keys))
        self.frame, self.pending = self.remember("frame", 7), self.remember("pending", k, 6)
        source = self._example_source()
        self._nodes = np.zeros(0, dtype=np.intp)
        self._holders = np.zeros(0, dtype=np.intp)
        for side, name in self.attached_sides():
            nodes = np.flatnonzero(source.sides[side])
            self._nodes = np.concatenate([self._nodes, nodes])
            self._holders = np.append(self._holders, [self._met(name, "attached", loose=False)] * len(nodes))
        self.anchors = self.remember("anchors", len(self._nodes), 3)
        example = self._example(source)
        self.faces = example.faces
        size = len(example.points())
        self.x, self.v = self.remember("x", size, 3), self.remember("v", size, 3)
        self.moved, self.state_row = self.remember("moved", 6), self.remember("state", example.state_size)
        if len(self.pads):
            self.pads.remember(self, size, len(self.faces))

    def joined(self, families: Sequence[Family]) -> None:
        if self.meets_surfaces:
            self.under = [one for one in families if isinstance(one, Surfaced)]
        if self.under:  # their points are in the state of its solver too
            self.state_row = self.remember("state", self._example(self._example_source()).state_size)

    def _example_source(self) -> FlexSource:
        """The flex with some parameters: sizes and faces do not depend on them."""
        return self.source(dict.fromkeys(self.drawn_keys, 0.1), np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]))

    def _example(self, source: FlexSource) -> SubWorld:
        """A model of it before anything is known of bodies and surfaces but how many they are."""
        k = len(self.met)
        built = ProxyMass(np.ones(k), np.zeros((k, 3)), np.tile([1.0, 1.0, 1.0, 0.0, 0.0, 0.0], (k, 1)))
        joints, slots = self._joints(self.anchors[0]), self.pads.slots(self.met)
        surfaces = [one.surface(0) for one in self.under]
        return SubWorld(source, self.scenery, built, joints, self._step, self._gravity, slots, surfaces)

    def _joints(self, anchors: Array) -> list[Joint]:
        rows = zip(self._nodes.tolist(), self._holders.tolist(), anchors, strict=True)
        return [Joint(node, place, anchor.copy()) for node, place, anchor in rows]

    def _met(self, name: str, key: str, *, loose: bool) -> int:
        """The place in `met` of a body, or of an object's root."""
        body, bodies = self.body(name, key), self.engine.world.bodies
        places = {int(i): place for place, i in enumerate(self.met) if not (loose and self._held[place])}
        if body not in places:
            kind = "free body" if loose else "body that moves and"
            known = listing([bodies[i].name for i in places])
            raise self.setting.fault(key, f"'{name}' is no {kind} that collides (there are: {known})")
        return places[body]

    def drawn_value(self, key: str, env_ids: Array) -> Array:
        """A parameter as it is in the episodes of these envs."""
        path = f"world.families.{self.setting.name}.{key}"
        stream = f"family/{self.setting.name}/{key}"
        return draw_rows(getattr(self.soft, key), stream, self.setting.streams, env_ids, source=path)

    def parameter(self, key: str, env: int) -> float:
        """A parameter as it is in an env's episode."""
        return float(self.values[env, self.drawn_keys.index(key)])

    # ------------------------------------------------------------------ its life

    def fill(self, env_ids: Array) -> None:
        for column, key in enumerate(self.drawn_keys):
            self.values[env_ids, column] = self.drawn_value(key, env_ids)
        place, yaw = self.drawn_value("position", env_ids), self.drawn_value("yaw", env_ids)
        if self._at is None:
            place = place + self.setting.origin[env_ids]
        else:
            pose = self.engine.get_state().body_pose[env_ids, self._at]
            heading = P.yaw(pose[:, 3:])
            place = pose[:, :3] + P.rotate(P.from_axis_angle(UP, heading), place)
            yaw = yaw + heading
        self.frame[env_ids] = np.concatenate([place, P.from_axis_angle(UP, yaw)], axis=1)
        now = self.engine.get_state()
        poses, joint_pos = now.body_pose[:, self.met[self._holders]], now.joint_pos
        for env in env_ids.tolist():
            one = self.sub_world(env)
            if len(self._nodes):
                one.load(one.beginning())
                away = one.node_places()[self._nodes] - poses[env, :, :3]
                self.anchors[env] = P.rotate_inverse(poses[env, :, 3:], away)
                one = self.sub_world(env)
            self.state_row[env] = one.beginning(self.pads.openings(joint_pos[env]))
            one.load(self.state_row[env])
            self.x[env] = one.points()

    def sub_world(self, env: int) -> SubWorld:
        """The model of an env: all that it is made of is in the memory, and it is made anew when that has changed."""
        parts = (self.values, self.frame, self.anchors, self._mass, self._com, self._inertia)
        surfaces = [one.surface(env) for one in self.under]
        drawn = [np.append(one.mass, one.friction) for one in surfaces]
        key = b"".join([*(part[env].tobytes() for part in parts), *(one.tobytes() for one in drawn)])
        made = self._worlds.get(env)
        if made is None or made[0] != key:
            mass = np.where(self._held, np.inf, self._mass[env] * self._heavier)
            bodies = ProxyMass(mass, self._com[env].copy(), self._inertia[env] * self._heavier[:, None])
            values = dict(zip(self.drawn_keys, self.values[env].tolist(), strict=True))
            source = self.source(values, self.frame[env])
            joints = self._joints(self.anchors[env])
            slots = self.pads.slots(self.met)
            rest = self.scenery, bodies, joints, self._step, self._gravity, slots, surfaces
            made = (key, SubWorld(source, *rest))
            self._worlds[env] = made
        return made[1]

    def solve(self, env_ids: Array, bodies: MetBodies, duration: float) -> Array:
        still = self.scenery.still
        pose, there = bodies.body_pose, bodies.there[:, self._entities]
        impulse = np.zeros((len(env_ids), len(self.met), 6))
        joint_pos = np.zeros((len(env_ids), 0))
        if len(self.pads):
            joint_pos = self.engine.get_state().joint_pos[env_ids]
            self.pads.look(env_ids, self.x[env_ids], pose, joint_pos)

        def one(row: int) -> None:
            env = int(env_ids[row])
            if not np.isfinite(self.state_row[env]).all():
                return
            sub = self.sub_world(env)
            sub.take(self.state_row[env])
            frames = bodies.frame[row], bodies.frame_twist[row], pose[row, still]
            sub.meet(*frames, there[row], bodies.friction[row])
            if len(self.pads):
                sub.hold(*self.pads.held(env))
            if self.pads.pinch:
                shut, openings = self.pads.shut(joint_pos[row]), self.pads.openings(joint_pos[row])
                sub.jaws.drive(sub.data, openings, shut, bodies.friction[row], duration)
            sub.surfaces.put(sub.data, [one.moving(env) for one in self.under])
            done = sub.step(self.soft.substeps, self.parameter("drag", env), env, self.push_on_nodes(env))
            if len(self.pads):
                self.pads.felt(env, sub.pulls())
            for other, pushed in zip(self.under, sub.surfaces.impulses, strict=True):
                other.touch(env, pushed)
            self.after_solve(env, sub)
            self.received[env] += done.received
            sub.save(self.state_row[env])
            self.moved[env] = sub.momentum()
            points = sub.points()
            if self.pads.pinch:
                self.pads.pinched(env, points, sub.faces, self.pads.shut(joint_pos[row]), sub.jaws.pressed(sub.data))
            np.subtract(points, self.x[env], out=self.v[env])
            self.v[env] /= duration
            self.x[env] = points
            due = self.pending[env] + done.impulse
            impulse[row] = np.where(self._late[:, None], SHARE * due, due)
            self.pending[env] = due - impulse[row]

        shared(one, range(len(env_ids)))
        return impulse

    def momentum(self, env_ids: Array) -> Array:
        """Of the matter, and of what held bodies will get."""
        return self.moved[env_ids] + self.pending[env_ids].sum(axis=1)

    # ------------------------------------------------------------------ what it looks like and means

    def state(self, env_ids: Array) -> FamilyState:
        size = self.x.shape[1]
        ids = np.full(size, self.setting.entities[0] + 1, dtype=np.int32)
        return FamilyState(
            self.x[env_ids].copy(), self.v[env_ids].copy(), np.full(size, self.radius), ids, self.faces.copy()
        )

    def fault(self, env_ids: Array) -> Array:
        return np.array([not np.isfinite(self.state_row[env]).all() for env in env_ids], dtype=bool)

    def facts(self, env: int) -> Mapping[str, Mapping[str, object]]:
        x = self.x[env]
        known: dict[str, object] = {"matter": self.label, "mass": self.mass(env)}
        known |= {"middle": x.mean(axis=0).tolist(), "low": x.min(axis=0).tolist(), "high": x.max(axis=0).tolist()}
        return {self.setting.name: known}

    @abstractmethod
    def mass(self, env: int) -> float:
        """[kg] of an env's matter."""

    def recorded(self, env_ids: Array) -> Mapping[str, Array]:
        """Momentum of the matter, its middle, and what it received: any difference of a point shows in them."""
        middle = self.x[env_ids].mean(axis=1)
        told = {"middle": middle, "momentum": self.momentum(env_ids), "received": self.received[env_ids]}
        return told | ({"pads": self.pads.stage[env_ids].astype(np.int8)} if len(self.pads) else {})

    def draw(self, env_ids: Array, view: CameraView, images: Mapping[str, Array]) -> None:
        from anysim_particles.draw import draw_triangles

        mark = self.setting.entities[0] + 1
        for row, env in enumerate(env_ids.tolist()):
            draw_triangles(self.x[env], self.faces, self.color, mark, view, row, images)
