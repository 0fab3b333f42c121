"""The contract of a family: matter or people that a plugin puts into the World, moves, and remembers.

A family adds entities to the neutral World (`parts`), which every engine builds, draws and segments as it does any
other. While the env runs it moves beside the engine: it reads poses and twists, says where the bodies that it drives
shall be (`drive`), and what it pushes at (`push`). All that it knows from one step to the next is in its memory,
arrays with one row per env: snapshots, partial resets and replays follow from that.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from anysim.compile.families import FamilyPart as FamilyPart
from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.cameras import CameraView
from anysim.engine.capability import Capability
from anysim.errors import PluginError, SpecError, SpecIssue, listing, suggest
from anysim.math import pose as P
from anysim.model.appearance import Rgb, rgb
from anysim.randomization.streams import Streams
from anysim_schemas.base import Spec


class FamilyState(NamedTuple):
    """What a family looks like in some envs, whatever it is made of.

    Attributes:
        points: (n, P, 3) [m], world axes.
        velocities: (n, P, 3) [m/s].
        radius: (P,) [m] of matter around each point.
        ids: (P,) int32, the segmentation id of the entity that each point belongs to.
        faces: (F, 3) int32 of a surface through points; no rows where there is none.
        fields: further numbers (n, P, …) of each point, by name.
    """

    points: Array
    velocities: Array
    radius: Array
    ids: Array
    faces: Array = np.zeros((0, 3), dtype=np.int32)
    fields: Mapping[str, Array] = MappingProxyType({})


class FamilySetting(NamedTuple):
    """What a family is made with.

    Attributes:
        name: in `world.families`.
        spec: its parameters, an instance of its `spec`.
        engine: has its World.
        streams: randomness of the envs; names of its streams begin with `family/NAME/`.
        entities: the indices of its entities, in the order of `parts`.
        origin: (N, 3) [m] where an env's scene stands on the ground; it may be another one after a reset.
    """

    name: str
    spec: Spec
    engine: SimEngine
    streams: Streams
    entities: tuple[int, ...]
    origin: Array

    def fault(self, key: str, words: str) -> SpecError:
        """What to raise where a key of the spec, `at` or `pads.left`, is at fault: the message points to its line."""
        return SpecError([SpecIssue("", f"world.families.{self.name}.{key}", words)])


def body_of(setting: FamilySetting, name: str, key: str | None = None) -> int:
    """The index of a body of the World, `ann.head`, or of the root of an object.

    Raises:
        SpecError: there is neither; it points to the key of the family's spec that names it.
        PluginError: likewise, where no key is given.
    """
    world = setting.engine.world
    if name in world.entity_numbers:
        return int(world.entities[world.entity_numbers[name]].root)
    names = [body.name for body in world.bodies]
    if name in names:
        return names.index(name)
    near = suggest(name, [*world.entity_numbers, *names])
    words = f"there is no body or object '{name}'{near} (objects: {listing([*world.entity_numbers])})"
    if key is None:
        raise PluginError(words)
    raise setting.fault(key, words)


class Family(ABC):
    """Made as `(setting)` when an env is built; all of its state is in `memory`.

    Attributes:
        spec: its parameters in YAML: a closed class, whose faults are told with file, line and column.
        needs: capabilities of the engine beyond those that its World needs.
        rate: whether it is asked at each physics step, or at each part of a control step that controllers make.
        drawn: whether it draws (`draw`) what engines do not: its matter.
        tint: red, green and blue of its matter where its parameters have no `color`.
        memory: (N, …) by name, zero when an episode begins: the whole of what it knows.
        bounds: (low, high) of those arrays whose values something else is looked up by.
    """

    spec: ClassVar[type[Spec]]
    needs: ClassVar[tuple[Capability, ...]] = ()
    rate: ClassVar[Literal["control", "physics"]] = "control"
    drawn: ClassVar[bool] = False
    tint: ClassVar[Rgb] = (0.5, 0.5, 0.5)

    def __init__(self, setting: FamilySetting) -> None:
        self.setting, self.engine = setting, setting.engine
        self.memory: dict[str, Array] = {}
        self.bounds: dict[str, tuple[float, float]] = {}
        self._driven = np.zeros(0, dtype=np.intp)

    def joined(self, families: Sequence["Family"]) -> None:
        """All families of the World are made, itself among them, in the order of the file."""

    # ------------------------------------------------------------------ the World

    @classmethod
    @abstractmethod
    def parts(cls, name: str, spec: Spec) -> Iterable[FamilyPart]:
        """The entities of a family that is called so; raise SpecError with paths below the family's own."""

    # ------------------------------------------------------------------ its life

    def remember(
        self, name: str, *shape: int, dtype: type = np.float64, bounds: tuple[float, float] | None = None
    ) -> Array:
        """A new array (N, *shape) of the memory; write into it, do not replace it.

        A snapshot may come from a file: values that are used as indices have `bounds`, outside of which it is refused.
        """
        self.memory[name] = np.zeros((self.engine.num_envs, *shape), dtype)
        if bounds is not None:
            self.bounds[name] = bounds
        return self.memory[name]

    @abstractmethod
    def reset(self, env_ids: Array) -> None:
        """Episodes begin in these envs: the memory is zero there, and everything else where it will be."""

    @abstractmethod
    def before_step(self, env_ids: Array, duration: float) -> None:
        """Move on by `duration` [s], which the engine is about to simulate in these envs."""

    def after_step(self, env_ids: Array, duration: float) -> None:
        """The engine has simulated that; its state can be read."""

    # ------------------------------------------------------------------ what it looks like and means

    @abstractmethod
    def state(self, env_ids: Array) -> FamilyState:
        """What it looks like now."""

    @property
    def color(self) -> Rgb:
        """Red, green and blue of its matter in images, each 0 to 1."""
        said = getattr(self.setting.spec, "color", None)
        return self.tint if said is None else rgb(said)

    def draw(self, env_ids: Array, view: CameraView, images: Mapping[str, Array]) -> None:
        """Draw its matter into images (n, H, W, …) as an engine has made them, where it is nearer than their `depth`.

        They have `depth`, which it must keep up to date, and maybe `rgb` and `segmentation`.
        """

    def fault(self, env_ids: Array) -> Array:
        """(n,) bool: envs whose matter is beyond repair, not finite; their episodes end as those of a broken engine."""
        return np.zeros(len(env_ids), dtype=bool)

    def facts(self, env: int) -> Mapping[str, Mapping[str, object]]:
        """What can be said of its entities now, plain data by entity."""
        return {}

    def recorded(self, env_ids: Array) -> Mapping[str, Array]:
        """What of its state is recorded at each control step, (n, …) by name, beside the poses of its bodies."""
        return {}

    # ------------------------------------------------------------------ exchange with the engine

    def body(self, name: str, key: str | None = None) -> int:
        """The index of a body of the World, `ann.head`, or of the root of an object, as `body_of` finds it."""
        return body_of(self.setting, name, key)

    def drives(self, bodies: Iterable[int]) -> None:
        """Say, when it is made, which bodies `place` and `drive` are about, K of them; it has to be said once."""
        self._driven = np.array([*bodies], dtype=np.intp)
        self._driven_pose = self.remember("driven", len(self._driven), 7)

    def place(self, env_ids: Array, pose: Array) -> None:
        """Put what it drives to poses (n, K, 7), at rest: at a reset."""
        self._driven_pose[env_ids] = pose
        self.engine.set_body_state(pose, np.zeros((*pose.shape[:2], 6)), env_ids, self._driven)

    def drive(self, env_ids: Array, pose: Array, duration: float) -> None:
        """Have what it drives come to poses (n, K, 7) in `duration` [s], with the velocity that takes it there.

        So what it pushes and carries moves as it should: a body that is put somewhere has no velocity of its surface.
        """
        before = self._driven_pose[env_ids]
        turn = P.multiply(pose[..., 3:], P.conjugate(before[..., 3:]))
        twist = np.concatenate([pose[..., :3] - before[..., :3], P.rotation_vector(turn)], axis=-1) / duration
        self.engine.set_body_state(before, twist, env_ids, self._driven)
        self._driven_pose[env_ids] = pose

    def push(self, env_ids: Array, wrench: Array, bodies: Array) -> None:
        """Add forces and torques (n, K, 6) [N, N m], world axes, at centres of mass, for the coming step alone."""
        self.engine.apply_wrench(wrench, bodies, env_ids, once=True)


class ObjectFamily:
    """What an object is; engines hold it by themselves."""

    spec: ClassVar[type[Spec]] = Spec


class Rigid(ObjectFamily):
    """One rigid body: what an object without joints is."""


class Articulation(ObjectFamily):
    """Links that joints move: what an object with joints is."""


class RigidInstancer(ObjectFamily):
    """Many bodies of one form as one object, with `family: rigid_instancer` and a `count`."""
