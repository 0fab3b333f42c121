"""The scene as terms see it: handles that read the engine's state for the rows at hand.

A term declares what it refers to by annotation (`a: Frame`, `robot: RobotView`); names become handles once, when the
env is built. A handle returns arrays for `scene.rows` only: all envs in a step, the reset ones in a reset.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from typing import ClassVar

import numpy as np

from anysim.controllers.base import ChannelColumns, columns
from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.state import State
from anysim.errors import NameLookupError, TaskError, listing, suggest
from anysim.geometry.bounds import EntityShape
from anysim.managers.base import Episodes
from anysim.managers.camera import CaptureManager
from anysim.managers.families import FamilyManager
from anysim.managers.sensors import SensorManager
from anysim.managers.terrain import TerrainManager
from anysim.math import pose as P
from anysim.model import frames
from anysim.model.affordance_lookup import find_affordance
from anysim.model.slots import members, single
from anysim.model.world import BodyKind, Channel, Entity
from anysim.task.memory import Memory
from anysim.task.slot_frames import CategoryView, Column, Follower, columns_of, varies


class SceneView:
    """The scene of all envs, restricted to `rows`. Values are computed once per moment however many terms ask."""

    def __init__(
        self, engine: SimEngine, episodes: Episodes | None = None, terrain: TerrainManager | None = None
    ) -> None:
        """`episodes` are those of an env's managers, `terrain` the one of them that has tiles."""
        self.engine = engine
        self.index = engine.index
        episodes = Episodes(engine.num_envs) if episodes is None else episodes
        self.goals: dict[str, Array] = {}
        """What commands want, by name: poses (N, 7), and of a commanded velocity (N, 3)."""
        self.drawn: dict[str, tuple[Array, Array]] = {}
        """What `Bindings.rows` returns."""
        self.last_action = np.zeros((engine.num_envs, 0))
        """The last action (N, A), clipped."""
        self.action_columns: dict[str, slice] = {}
        """Columns of the action by `robot.channel`."""
        self.origin = episodes.origin
        """Where each env's scene stands on the ground (N, 3) [m]."""
        self.terrain = terrain
        """The manager of tiles and levels; None in a scene without managers."""
        self.elapsed = episodes.elapsed
        """Control steps since each env's reset (N,)."""
        self.capture: CaptureManager | None = None
        """The manager that keeps images; None in a scene without managers."""
        self.sensors: SensorManager | None = None
        """The manager of sensors; None where there are none."""
        self.families: FamilyManager | None = None
        """The manager of families; None where there are none."""
        self.memories: list[Memory] = []
        """What terms remember, in the order in which they were made."""
        self._rows: Array | slice = slice(None)
        self._everyone = self._env_ids = np.arange(engine.num_envs)
        self._everyone.setflags(write=False)
        self._frames: dict[str, Frame] = {}
        self._robots: dict[str, RobotView] = {}
        self._shapes: dict[str, EntityShape] = {}
        self._seen: State | None = None
        self.moment = 0
        self.population = 0
        """Changes whenever the entities that are there may have changed."""
        self.presence = engine.presence
        """(N, entities) bool: which of the World's entities are there; as of the last `meet`."""

    def meet(self) -> None:
        """The entities that are there may have changed: look again."""
        if self.engine.world.slots:
            self.presence = self.engine.presence
            self.population += 1

    def look(self, rows: Array | None) -> None:
        """Look at all envs (None), or these; a new moment unless neither they nor the engine's state have changed."""
        state = self.engine.get_state()
        if rows is None or (len(rows) == len(self._everyone) and (rows == self._everyone).all()):
            if state is not self._seen or self._env_ids is not self._everyone:
                self.moment += 1
            self._rows, self._env_ids = slice(None), self._everyone
        else:
            self._rows, self._env_ids = rows, self._everyone[rows]
            self.moment += 1
        self._seen = state

    @property
    def rows(self) -> Array | slice:
        """What indexes an (N, ...) array down to the rows at hand."""
        return self._rows

    @property
    def poses(self) -> dict[str, Array]:
        """The goals that are poses (N, 7)."""
        return {name: goal for name, goal in self.goals.items() if goal.shape[1] == 7}

    @property
    def env_ids(self) -> Array:
        """The envs at hand (n,)."""
        return self._env_ids

    @property
    def state(self) -> State:
        """The engine's state, of all envs: index it with `rows`."""
        return self.engine.get_state()

    def frame(self, name: str) -> "Frame":
        """The handle of a frame or goal."""
        handle = self._frames.get(name)
        if handle is None:
            handle = GoalFrame(self, name) if name in self.poses else self._world_frame(name)
            self._frames[name] = handle
        return handle

    def _world_frame(self, name: str) -> "Frame":
        try:
            return self._frame_of(name)
        except NameLookupError as error:
            goals = f" Goals: {listing(self.poses)}{suggest(name, list(self.poses))}." if self.poses else ""
            raise NameLookupError(f"{error}.{goals}") from None

    def _frame_of(self, name: str) -> "Frame":
        if "/" in name:
            return self._affordance(name)
        world, (owner, dot, part) = self.engine.world, name.partition(".")
        if not members(world, owner):
            return BodyFrame(self, name, self.index.frame(name))
        slot = single(world, owner)
        if varies(world, slot):
            return SlotFrame(self, name, columns_of(world, name)[0])
        whole = f"{slot.name}{dot}{part}"
        return BodyFrame(self, whole, self.index.frame(whole))

    def _affordance(self, name: str) -> "Frame":
        """The frame of an affordance, `cabinet/drawer_1.handle`."""
        world, (owner, _, local) = self.engine.world, name.partition("/")
        slots = members(world, owner)
        if not (slots and varies(world, slot := single(world, owner))):
            return BodyFrame(self, name, find_affordance(world, f"{owner}.{local}").frame)
        each = (find_affordance(world, f"{world.entities[e].name}.{local}").frame for e in slot.entities)
        return SlotFrame(self, name, Column(slot.name, slot.entities, tuple(each)))

    def memory(self, width: int = 1) -> Callable[[Callable[[Array, Array], Array]], Array]:
        """A new `Memory`, as the function that updates the rows at hand and returns them (n, width)."""
        memory = Memory(self.engine.num_envs, width)
        self.memories.append(memory)
        return lambda change: memory.update(self._env_ids, self.elapsed[self._env_ids], change)

    def entity_shape(self, name: str) -> EntityShape:
        """The collision geometry of an entity of the World; made once."""
        shape = self._shapes.get(name)
        if shape is None:
            shape = self._shapes[name] = EntityShape(self.engine.world, name)
        return shape

    def category(self, name: str) -> CategoryView:
        """The handle of all instances of a category."""
        return CategoryView(self, name)

    def robot(self, name: str) -> "RobotView":
        """The handle of a robot."""
        handle = self._robots.get(name)
        if handle is None:
            handle = self._robots[name] = RobotView(self, name)
        return handle


class DrawnView:
    """What `collect.bind` can draw, as `rows` (V, k), and the `index` (N,) of each env's. In YAML: its name."""

    reference_kind: ClassVar[str] = "drawn value"

    def __init__(self, scene: SceneView, name: str) -> None:
        if name not in scene.drawn:
            hint = suggest(name, list(scene.drawn))
            raise NameLookupError(f"collect.bind has no '{name}'{hint}; it has {listing(scene.drawn)}")
        self.rows, self.index = scene.drawn[name]


class Frame(ABC):
    """A frame in the world: an entity, a link, a tool or a goal. In YAML: its name."""

    reference_kind: ClassVar[str] = "frame"

    def __init__(self, scene: SceneView, name: str) -> None:
        self.scene, self.name = scene, name
        self._moment, self._pose = -1, np.zeros((0, 7))
        self._position, self._quaternion = self._pose[:, :3], self._pose[:, 3:]

    def _see(self) -> None:
        """Work the pose out, once a moment."""
        self._pose, self._moment = self._compute(), self.scene.moment
        self._position, self._quaternion = self._pose[:, :3], self._pose[:, 3:]

    @property
    def pose(self) -> Array:
        """(n, 7) in the world frame."""
        if self._moment != self.scene.moment:
            self._see()
        return self._pose

    @property
    def position(self) -> Array:
        """(n, 3) [m]."""
        if self._moment != self.scene.moment:
            self._see()
        return self._position

    @property
    def quaternion(self) -> Array:
        """(n, 4) xyzw."""
        if self._moment != self.scene.moment:
            self._see()
        return self._quaternion

    @property
    def twist(self) -> Array:
        """(n, 6): velocity of the frame's origin [m/s] and rate [rad/s], world axes."""
        return np.zeros((len(self.pose), 6))

    @property
    def present(self) -> Array:
        """(n,) bool: whether what it belongs to is there; what is absent has the world's own frame."""
        return np.ones(len(self.scene.env_ids), dtype=bool)

    @abstractmethod
    def _compute(self) -> Array:
        """The pose (n, 7) now."""


class GoalFrame(Frame):
    """Where a command wants something to be."""

    def _compute(self) -> Array:
        return self.scene.goals[self.name][self.scene.rows]


class BodyFrame(Frame):
    """A frame fixed to a body."""

    def __init__(self, scene: SceneView, name: str, frame: frames.FixedFrame) -> None:
        super().__init__(scene, name)
        self.index = frame
        local = np.array([*frame.position, *frame.quaternion])
        self._local = None if (local == [0, 0, 0, 0, 0, 0, 1]).all() else P.Offset(local)
        self._fixed = local[None]

    def _compute(self) -> Array:
        if self.index.body < 0:
            return np.repeat(self._fixed, len(self.scene.env_ids), axis=0)
        body = self.scene.state.body_pose[self.scene.rows, self.index.body]
        return body if self._local is None else self._local.seen_from(body)

    @property
    def twist(self) -> Array:
        if self.index.body < 0:
            return np.zeros((len(self.scene.env_ids), 6))
        body = self.scene.state.body_twist[self.scene.rows, self.index.body]
        if self._local is None:
            return body
        pose = self.scene.state.body_pose[self.scene.rows, self.index.body]
        arm = self.position - pose[:, :3]
        return np.concatenate([body[:, :3] + P.cross(body[:, 3:], arm), body[:, 3:]], axis=-1)


class SlotFrame(Frame):
    """A frame of an object that is not the same in every env: it follows what is there."""

    def __init__(self, scene: SceneView, name: str, column: Column) -> None:
        super().__init__(scene, name)
        self._follower = Follower(scene, [column])

    def _compute(self) -> Array:
        return self._follower.poses[:, 0]

    @property
    def twist(self) -> Array:
        return self._follower.twists[:, 0]

    @property
    def present(self) -> Array:
        return self._follower.present[:, 0]


class Jointed(ABC):
    """What has joints of its own."""

    scene: SceneView

    @property
    @abstractmethod
    def joints(self) -> slice:
        """Its joints among the world's."""

    @property
    def joint_pos(self) -> Array:
        """(n, J) [rad, m] of its joints."""
        return self.scene.state.joint_pos[self.scene.rows, self.joints]

    @property
    def joint_vel(self) -> Array:
        """(n, J) [rad/s, m/s] of its joints."""
        return self.scene.state.joint_vel[self.scene.rows, self.joints]


class ObjectView(Jointed):
    """An object of the world, whatever it is in each env. In YAML: its name."""

    reference_kind: ClassVar[str] = "object"

    def __init__(self, scene: SceneView, name: str) -> None:
        world = scene.engine.world
        self.scene, self.name = scene, name
        self.slot = single(world, name)
        self.entities: tuple[Entity, ...] = tuple(world.entities[e] for e in self.slot.entities)
        """All that it can be."""
        self.root = scene.frame(name)
        self.movable = all(world.bodies[entity.root].kind is BodyKind.FREE for entity in self.entities)
        self._initial = world.initial_body_pose[[entity.root for entity in self.entities]]
        self._nominal, self._population = np.zeros((0, 7)), -1

    @property
    def entity(self) -> Entity:
        """The entity that it is in every env; TaskError where it can be several."""
        first, *others = self.entities
        if others:
            raise TaskError(
                f"'{self.name}' can be {listing([e.name for e in self.entities])}; "
                f"`by_entity` says which it is in each env"
            )
        return first

    @property
    def present(self) -> Array:
        """(n,) bool: whether it is there."""
        return self.root.present

    @property
    def nominal_pose(self) -> Array:
        """(n, 7) where the World has it before anything is drawn, as what it is in each env."""
        if self._population != self.scene.population:
            there = self.scene.presence[:, self.slot.entities]
            self._nominal, self._population = self._initial[there.argmax(axis=1)], self.scene.population
        return self._nominal[self.scene.rows]

    def by_entity(self, env_ids: Array) -> Iterator[tuple[Entity, Array]]:
        """What it is in these envs: each entity with those of the envs in which it is there."""
        for index, entity in zip(self.slot.entities, self.entities, strict=True):
            own = env_ids[self.scene.presence[env_ids, index]]
            if len(own):
                yield entity, own

    @property
    def joints(self) -> slice:
        """Its joints among the world's; TaskError where it can be several things."""
        return slice(self.entity.joint_start, self.entity.joint_stop)


class RobotView(Jointed):
    """A robot of the world. In YAML: its name."""

    reference_kind: ClassVar[str] = "robot"

    def __init__(self, scene: SceneView, name: str) -> None:
        self.scene, self.name = scene, name
        self.model = scene.index.robot(name)
        entity = scene.index.entity(name)
        self._joints = slice(entity.joint_start, entity.joint_stop)
        world = scene.engine.world
        arm = [j for c in self.model.channels.values() if c.opened is None for j in c.joints]
        self.arm_joints = np.array(sorted(arm), dtype=int)
        """World indices of the joints of all channels that are no grippers."""
        self._arm = columns(self.arm_joints)
        self._channels: dict[str, ChannelColumns] = {}
        self.lower = np.array([j.lower for j in world.joints[self._joints]])
        self.upper = np.array([j.upper for j in world.joints[self._joints]])

    @property
    def joints(self) -> slice:
        """Its joints among the world's."""
        return self._joints

    @property
    def arm_speed(self) -> Array:
        """(n,) the largest absolute joint velocity outside the grippers."""
        velocity = self.scene.state.joint_vel[self.scene.rows][:, self._arm]
        return np.maximum.reduce(np.abs(velocity), axis=1)

    def tool(self, name: str = "tool") -> Frame:
        """The frame of one of its tools."""
        return self.scene.frame(f"{self.name}.{name}")

    @property
    def base(self) -> Frame:
        """The frame of its base."""
        return self.scene.frame(self.name)

    def channel(self, name: str) -> Channel:
        """One of its channels.

        Raises:
            NameLookupError: lists those that it has.
        """
        if name not in self.model.channels:
            known = list(self.model.channels)
            raise NameLookupError(
                f"robot '{self.name}' has no channel '{name}'{suggest(name, known)} (channels: {listing(known)})"
            )
        return self.model.channels[name]

    def channel_columns(self, name: str) -> ChannelColumns:
        """What addresses the joints and drives of one of its channels; looked up once."""
        found = self._channels.get(name)
        if found is None:
            found = self._channels[name] = ChannelColumns.of(self.scene.engine.world, self.channel(name))
        return found
