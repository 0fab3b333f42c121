"""Engines whose library has a world of its own for each env: PhysX' scenes, Bullet's clients.

`EnvWorlds` is what a backend writes: what is done to one env. `OneWorldPerEnv` makes an engine of it: it goes through
the envs, keeps what the last substep left, joins what they say, and carries it over into snapshots and rebuilt worlds.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.cameras import CameraView
from anysim.engine.control import Control
from anysim.engine.parameters import APPEARANCE, ParameterTable
from anysim.engine.state import ContactPoints, RayHits, SnapshotLevel, joined_rows
from anysim.model.world import World
from anysim_mechanics.one_world.last_substep import CarriedSubstep, LastSubstep


class Painter(Protocol):
    """What draws the envs of one engine."""

    def draw(
        self, view: CameraView, ids: Array, skins: tuple[Array, ...], there: Array, channels: tuple[str, ...]
    ) -> dict[str, Array]:
        """Images as `SimEngine.render` says.

        `skins` are colour (E, G, 4), texture and material (E, G) of the geoms; `there` (E, B) are the bodies there.
        """
        ...

    def close(self) -> None:
        """Free what drawing took."""
        ...


class EnvWorlds(ABC):
    """The worlds of all envs, and what is kept beside them: what a build makes and `close` frees.

    Methods mean what the primitives of `anysim.engine.primitives` say, of one env and without its axis. A world that
    loses its memory when it is built anew calls `last.settle(env)` before.

    Attributes:
        last: what the last substep of each env left.
        lost: (N,) bool, envs that were given up: they are not stepped until a reset.
        parameters: those of all envs.
    """

    last: LastSubstep
    lost: Array
    parameters: ParameterTable

    @abstractmethod
    def close(self) -> None:
        """Free everything. May be called again."""

    @abstractmethod
    def reset(self, env: int) -> None:
        """Bring an env into the World's initial state, with nothing left over; a lost one is good again."""

    def populate(self, env: int, present: Array) -> None:
        """Have an env hold the entities (E,) that are there, and no others; a reset of it follows."""

    @abstractmethod
    def step(self, env: int, n_steps: int) -> None:
        """Advance an env by n physics steps."""

    @abstractmethod
    def read(self, name: str) -> Array:
        """A fresh array, of all envs: `body_pose`, `body_twist`, `joint_pos`, `joint_vel` or `fault`."""

    @abstractmethod
    def write_joints(self, env: int, joints: Array, position: Array | None, velocity: Array | None) -> None:
        """Write values (K,)."""

    @abstractmethod
    def write_bodies(self, env: int, bodies: Array, pose: Array | None, twist: Array | None) -> None:
        """Write poses (K, 7) of root bodies and twists (K, 6) of free ones."""

    @abstractmethod
    def apply_control(self, control: Control) -> None:
        """Take over the commands of all envs."""

    def apply_wrench(self, wrench: Array | None) -> None:
        """Set external wrenches (N, B, 6) of all envs, or clear them."""

    @abstractmethod
    def rows(self, env: int, level: SnapshotLevel) -> Mapping[str, ArrayLike]:
        """Everything beyond `last`, commands and parameters that continuing needs."""

    @abstractmethod
    def put_rows(self, env: int, rows: Mapping[str, Array], level: SnapshotLevel) -> None:
        """Write what `rows` returned."""

    def contacts(self, env: int) -> list[tuple[Array, ...]]:
        """Parts of columns of `ContactPoints` but for the first, its env."""
        return []

    def raycast(self, env: int, origins: Array, directions: Array) -> tuple[Array, Array]:
        """Distances (R,), infinite where nothing is hit, and the bodies (R,) that are, -1 for the world's geoms."""
        raise NotImplementedError

    def painter(self) -> Painter:
        """Something to draw with."""
        raise NotImplementedError

    def read_back(self) -> Mapping[str, Array]:
        """See `Primitives.read_back`."""
        return {}

    def handles(self) -> Mapping[str, int]:
        """See `Primitives.handles`."""
        return {}

    def raw_loop(self, control: Control) -> Callable[[int], None] | None:
        """See `Primitives.raw_loop`."""
        return None


class OneWorldPerEnv(SimEngine):
    """An engine that steps the worlds of its envs one after the other; see the module's docstring."""

    _envs: EnvWorlds

    @abstractmethod
    def _make(self, world: World, present: Array) -> EnvWorlds:
        """Make the worlds of N envs that hold these entities (N, E). A failure must leave nothing behind."""

    def _build(self, world: World, num_envs: int) -> None:
        self._painter: Painter | None = None
        self._envs = self._make(world, self._presence.entities)

    def _free(self) -> None:
        if self._painter is not None:
            self._painter.close()
        self._envs.close()
        del self._envs, self._painter

    def _reset(self, ids: Array) -> None:
        for env in ids.tolist():
            self._envs.reset(env)
            self._envs.last.hold(env, 0.0, 0.0)

    def _populate(self, ids: Array) -> None:
        for env in ids.tolist():
            self._envs.populate(env, self._presence.entities[env])

    # ------------------------------------------------------------------ stepping and writing

    def _step(self, n_steps: int, ids: Array | None) -> None:
        envs, lost = self._envs, self._envs.lost
        for env in range(self.num_envs) if ids is None else ids.tolist():
            if not lost[env]:
                envs.step(env, n_steps)
                envs.last.stepped(env)

    def _read(self, name: str) -> Array:
        if name == "joint_effort":
            return self._envs.last.efforts()
        if name == "contact_force":
            return self._envs.last.contacts()
        return self._envs.last.cover(name, self._envs.read(name))

    def _write_joints(self, ids: Array, joints: Array, position: Array | None, velocity: Array | None) -> None:
        for row, env in enumerate(ids.tolist()):
            self._envs.last.touch(env)
            self._envs.write_joints(env, joints, _row(position, row), _row(velocity, row))

    def _write_bodies(self, ids: Array, bodies: Array, pose: Array | None, twist: Array | None) -> None:
        for row, env in enumerate(ids.tolist()):
            self._envs.last.touch(env)
            self._envs.write_bodies(env, bodies, _row(pose, row), _row(twist, row))

    def _apply_control(self, control: Control) -> None:
        self._envs.apply_control(control)

    def _apply_wrench(self, wrench: Array | None) -> None:
        self._envs.apply_wrench(wrench)

    # ------------------------------------------------------------------ parameters, snapshots, live editing

    def _get_parameter(self, name: str) -> Array:
        return self._envs.parameters.get(name)

    def _set_parameter(self, name: str, values: Array, ids: Array, indices: Array) -> None:
        self._envs.parameters.set(name, values, ids, indices)
        if name not in APPEARANCE:  # drives may have to be told anew, by their gains or in a world that was built anew
            self._commands.control_changed = True

    def _default_parameter(self, name: str) -> Array:
        return self._envs.parameters.default(name)

    def _snapshot(self, ids: Array, level: SnapshotLevel) -> dict[str, Array]:
        parts: list[dict[str, Array]] = []
        for env in ids.tolist():
            self._envs.last.settle(env)
            parts.append({name: np.asarray(row)[None] for name, row in self._envs.rows(env, level).items()})
        return joined_rows(parts) | self._envs.last.rows(ids)

    def _restore(self, ids: Array, data: Mapping[str, Array], level: SnapshotLevel) -> None:
        for row, env in enumerate(ids.tolist()):
            self._envs.put_rows(env, {name: rows[row] for name, rows in data.items()}, level)
            self._envs.last.put_row(env, data, row)

    def _carry_rows(self) -> CarriedSubstep:
        last = self._envs.last
        return CarriedSubstep(self._motion(), last.efforts(), last.contacts())

    def _take_rows(self, carried: CarriedSubstep, old: World) -> None:
        self._envs.last.take(carried, old, self._motion())

    def _motion(self) -> Array:
        return np.concatenate([self._read("body_pose"), self._read("body_twist")], axis=-1)

    # ------------------------------------------------------------------ sensing

    def _contacts(self, ids: Array) -> ContactPoints:
        parts = [(env, columns) for env in ids.tolist() for columns in self._envs.contacts(env)]
        return ContactPoints.joined([(np.full(len(columns[0]), env), *columns) for env, columns in parts])

    def _raycast(self, origins: Array, directions: Array, ids: Array) -> RayHits:
        distance, body = np.empty(origins.shape[:2]), np.empty(origins.shape[:2], dtype=int)
        for row, env in enumerate(ids.tolist()):
            distance[row], body[row] = self._envs.raycast(env, origins[row], directions[row])
        entity = np.array([*self.world.body_entity, -1]) + 1  # the last one is the world's, by its index of -1
        return RayHits(distance, np.where(np.isfinite(distance), entity[body], -1))

    def _render(self, view: CameraView, ids: Array, channels: tuple[str, ...]) -> dict[str, Array]:
        if self._painter is None:
            self._painter = self._envs.painter()
        values = self._envs.parameters.values
        skins = tuple(values[name][ids] for name in ("geom.color", "geom.texture", "geom.material"))
        return self._painter.draw(view, ids, skins, self._presence.bodies[ids], channels)

    def read_back(self) -> Mapping[str, Array]:
        """See `EnvWorlds.read_back`."""
        with self._lock:
            self._require_world()
            return self._envs.read_back()

    def handles(self) -> Mapping[str, int]:
        """See `EnvWorlds.handles`."""
        with self._lock:
            self._require_world()
            return self._envs.handles()

    def raw_loop(self) -> Callable[[int], None] | None:
        """See `EnvWorlds.raw_loop`."""
        with self._lock:
            self._require_world()
            return self._envs.raw_loop(self.control)


def _row(values: Array | None, row: int) -> Array | None:
    return None if values is None else values[row]
