"""Primitives behind SimEngine's public methods, which a backend writes.

Arguments arrive checked: ids and indices are unique int arrays in range, values are float64, finite and of the right
shape. The names mean what the public methods of `anysim.engine.base.SimEngine` say.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

from anysim.conventions import Array
from anysim.engine.cameras import CameraView
from anysim.engine.capability import Capability
from anysim.engine.control import Control
from anysim.engine.state import ContactPoints, RayHits, SnapshotLevel
from anysim.errors import CapabilityError
from anysim.model.world import World


class Primitives(ABC):
    """Abstract ones every engine has; the others raise CapabilityError where the capability is not declared."""

    name: ClassVar[str]
    ragged_rows: ClassVar[frozenset[str]] = frozenset()
    """Names in `_snapshot` whose rows may have any length, which the engine keeps beside."""

    @abstractmethod
    def _build(self, world: World, num_envs: int) -> None:
        """Make `num_envs` copies. A failure must leave nothing behind."""

    @abstractmethod
    def _free(self) -> None:
        """Free what `_build` made."""

    @abstractmethod
    def _reset(self, ids: Array) -> None:
        """Write the World's initial state, with nothing left over (warm starts, accumulated forces)."""

    def _populate(self, ids: Array) -> None:
        """Have in these envs the entities that `self._presence` says, and no others; `_reset` of them follows.

        What is absent is as if it were not in the World: nothing touches it, sees it or hits it with a ray.
        """
        raise self._absent(Capability.VARYING_ENTITIES)

    @abstractmethod
    def _step(self, n_steps: int, ids: Array | None) -> None:
        """Advance all envs, or those in `ids`, by n physics steps. Must not disturb the others."""

    @abstractmethod
    def _read(self, name: str) -> Array:
        """A fresh array of one of `anysim.engine.state.FIELDS`, consistent with all writes so far."""

    @abstractmethod
    def _write_joints(self, ids: Array, joints: Array, position: Array | None, velocity: Array | None) -> None:
        """Write (E, K) values."""

    @abstractmethod
    def _write_bodies(self, ids: Array, bodies: Array, pose: Array | None, twist: Array | None) -> None:
        """Write poses (E, K, 7) of root bodies and twists (E, K, 6) of free ones."""

    @abstractmethod
    def _apply_control(self, control: Control) -> None:
        """Take over the commands of all envs; called before a step after any of them changed."""

    def _apply_wrench(self, wrench: Array | None) -> None:
        """Set external wrenches (N, B, 6) at the centres of mass, or clear them."""
        raise self._absent(Capability.WRENCHES)

    def _get_parameter(self, name: str) -> Array:
        """All values (N, K, ...) of one of `self.parameters`."""
        raise self._absent(Capability.PARAMETERS_PER_ENV)

    def _set_parameter(self, name: str, values: Array, ids: Array, indices: Array) -> None:
        """Write values (E, K, ...) of one of `self.parameters`."""
        raise self._absent(Capability.PARAMETERS_PER_ENV)

    def _default_parameter(self, name: str) -> Array:
        """Values (K, ...) as built from the World."""
        raise self._absent(Capability.PARAMETERS_PER_ENV)

    @abstractmethod
    def _snapshot(self, ids: Array, level: SnapshotLevel) -> dict[str, Array]:
        """Everything beyond commands, parameters and cameras that continuing needs; arrays with leading env axis.

        Each row stands for itself. Those that `ragged_rows` names may have any length that the engine keeps beside:
        further zeros at their end are to be passed over, since rows of several engines may be joined. All others have
        the same type and shape in every env, whatever is in it.
        """

    @classmethod
    def refuse_rows(cls, data: Mapping[str, Array], level: SnapshotLevel, world: World, options: object) -> None:
        """Raise SnapshotError where `_restore` could not go on from these rows: they may come from a file.

        Their names, types and shapes are those of `_snapshot`, and they are finite but for rows whose `fault` is true.
        """

    @abstractmethod
    def _restore(self, ids: Array, data: Mapping[str, Array], level: SnapshotLevel) -> None:
        """Write rows that `_snapshot` made."""

    def _carry_rows(self) -> Any:
        """Solver state to carry across a rebuild, in a form that `_take_rows` of the new build understands."""
        return None

    def _take_rows(self, carried: Any, old: World) -> None:
        """Take over by name what `_carry_rows` of the old build returned (warm starts and the like)."""

    def _render(self, view: CameraView, ids: Array, channels: tuple[str, ...]) -> dict[str, Array]:
        """Images of one camera for the envs in `ids`, as `render` documents, bodies drawn at `view.body_pose`.

        Those poses need not be the present ones, and drawing must not change the state.
        """
        raise self._absent(Capability.RENDER_RGB)

    def _raycast(self, origins: Array, directions: Array, ids: Array) -> RayHits:
        """Rays (E, R, 3), unit directions."""
        raise self._absent(Capability.RAYCAST)

    def _contacts(self, ids: Array) -> ContactPoints:
        """Contact points of envs."""
        raise self._absent(Capability.CONTACT_POINTS)

    def read_back(self) -> Mapping[str, Array]:
        """What the engine itself says of env 0, for an audit, beyond its parameters.

        Any of `joint.limits` (J, 2) [rad, m], infinite where there is none, `geom.volume` (G,) [m^3] of the shapes
        that collide, 0 for planes and height fields, and `body.mass`, `body.com`, `body.inertia` in the form of the
        parameters, of an engine that cannot change them all.
        """
        return {}

    def handles(self) -> Mapping[str, int]:
        """How many things of its library the engine holds, by kind, for checks that nothing accumulates."""
        return {}

    def renderer_name(self) -> str:
        """What draws the images (driver, software or GPU), for `anysim doctor`; empty if nothing does."""
        return ""

    def processor_times(self) -> tuple[float, ...]:
        """Processor time [s] that each process which steps envs for this one has spent so far, for benchmarks."""
        return ()

    def raw_loop(self) -> Callable[[int], None] | None:
        """The engine's own loop without anysim, for benchmarks: a function of the number of physics steps.

        Each call writes the drives' commands, in turn those of `anysim.engine.control.alternating`, steps a private
        copy of the present state, and copies out the arrays from which joint positions and velocities, body poses and
        twists are made. None where an engine has none.
        """
        return None

    def _absent(self, capability: Capability) -> CapabilityError:
        return CapabilityError(f"{self.name} does not have '{capability}'")
