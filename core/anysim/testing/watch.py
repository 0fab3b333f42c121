"""States that no world of the suite can be in: whatever a test reads is looked at, in every test.

Nothing is read that the test does not read itself. A state must be finite or marked in `State.fault`, of a size that
the suite's worlds can have, with quaternions of unit length. Where nothing drives an env its mechanical energy must not
grow between two readings.
"""

import weakref
from collections.abc import Callable, Mapping
from inspect import signature
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.capability import Capability
from anysim.engine.state import State
from anysim.math import pose as P
from anysim.model.world import BodyKind, World
from anysim.testing import tolerances

BOUNDS = {
    "body_pose": 1e3,
    "body_twist": 1e3,
    "joint_pos": 1e3,
    "joint_vel": 1e3,
    "joint_effort": 1e6,
    "contact_force": 1e6,
}
"""The largest magnitude of each field, in its units: worlds of some metres that run for some seconds stay far below."""

_READ = "_read_locked"
"""What a `State` calls for each of its fields."""

_ACTS = ("set_joint_state", "set_body_state", "reset", "restore", "set_parameters", "_apply_wrench")
"""What moves things from outside. An engine's own calls of its primitives are its physics."""


class ImpossibleState(AssertionError):
    """An engine gave out a state that it cannot be in."""


def watch(engine: SimEngine, energy: bool = True) -> None:
    """Look at all that is read of this engine from now on; without `energy` at sizes alone."""
    watcher, itself = _Watcher(energy and Capability.DYNAMICS in engine.capabilities), weakref.ref(engine)

    def read(name: str) -> Array:
        watched: Any = itself()
        array = getattr(type(watched), _READ)(watched, name)
        watcher.look(watched, name, array)
        return array

    def acting(name: str) -> Callable[..., Any]:
        def act(*arguments: Any, **named: Any) -> Any:
            watched: Any = itself()
            method = getattr(type(watched), name)
            result = method(watched, *arguments, **named)
            watcher.note(watched.num_envs, name, signature(method).bind(watched, *arguments, **named).arguments)
            return result

        return act

    vars(engine).update({name: acting(name) for name in _ACTS}, **{_READ: read})


class _Watcher:
    """What was done to one engine and read of it so far."""

    def __init__(self, energy: bool) -> None:
        self.counts = energy
        self.world: World | None = None
        self.state: State | None = None
        self.parts: dict[str, Array] = {}
        self.level: Array | None = None  # (N,) energy when it was first read after something was done
        self.turned = np.zeros(0)  # (N,) the most that was turned over since
        self.absurd = np.zeros(0, dtype=bool)  # (N,) envs into which a test wrote what no world can be in

    def note(self, num_envs: int, name: str, arguments: Mapping[str, Any]) -> None:
        """Something was done from outside."""
        self.level = None
        if name == "set_parameters":
            self.counts = False  # the masses are no longer those of the World
        if len(self.absurd) != num_envs:
            self.absurd = np.zeros(num_envs, dtype=bool)
        ids = arguments.get("env_ids")
        which = slice(None) if ids is None else np.asarray(ids, dtype=int)
        if name == "reset":
            self.absurd[which] = False
        written = [arguments[part] for part in ("pose", "twist", "position", "velocity") if part in arguments]
        if any(np.abs(np.asarray(part, dtype=float)).max(initial=0.0) > 1e3 for part in written if part is not None):
            self.absurd[which] = True

    def look(self, engine: SimEngine, name: str, array: Array) -> None:
        """A field was read.

        Raises:
            ImpossibleState: nothing can be there.
        """
        if name not in BOUNDS:
            return
        rows = array.reshape(len(array), -1)
        with np.errstate(invalid="ignore"):
            wild = np.asarray(~(np.abs(rows) <= BOUNDS[name]).all(axis=1))
        if len(self.absurd) == len(wild):
            wild &= ~self.absurd
        if wild.any():
            self._judge(engine, name, array, np.flatnonzero(wild))
        elif name == "body_pose" and len(self.absurd) == len(array):
            length = np.abs(P.norm(array[..., 3:]) - 1.0)[~self.absurd]
            worst = float(length.max(initial=0.0))
            if worst > tolerances.KINEMATICS * 10:
                raise ImpossibleState(f"a quaternion of body_pose has a length of 1 {worst:+.3g}; it must be 1")
        if self.counts and name in ("body_pose", "body_twist") and not wild.any():
            self._weigh(engine, name, array)

    def _judge(self, engine: SimEngine, name: str, array: Array, envs: Array) -> None:
        finite = np.asarray(np.isfinite(array).reshape(len(array), -1).all(axis=1))
        fault = getattr(type(engine), _READ)(engine, "fault")  # `get_state` would look again
        for env in envs.tolist():
            if fault[env]:
                continue
            if not finite[env]:
                raise ImpossibleState(f"{name} of env {env} is not finite, and State.fault does not say so")
            place = np.unravel_index(int(np.abs(array[env]).argmax()), array[env].shape)
            things = engine.world.bodies if name.startswith("body") else engine.world.joints
            thing = f" of '{things[place[0]].name}'" if name in list(BOUNDS)[:5] else ""
            raise ImpossibleState(
                f"{name}{thing} in env {env} is {array[env][place]:.3g}; no world of the suite goes beyond "
                f"{BOUNDS[name]:g}, and State.fault does not mark the env"
            )

    def _weigh(self, engine: SimEngine, name: str, array: Array) -> None:
        """The mechanical energy, where place and speed of one moment were read."""
        if engine.world is not self.world:
            self.world, self.level = engine.world, None
            self.counts = self.counts and undriven(engine.world)
        state = engine.get_state()
        if state is not self.state:
            self.state, self.parts = state, {}
        self.parts[name] = array
        if len(self.parts) < 2 or not self.counts:
            return
        kinetic, potential = energies(engine.world, self.parts["body_pose"], self.parts["body_twist"])
        total = kinetic + potential
        if self.level is None or len(self.level) != len(total):
            self.level, self.start, self.turned = total, potential, kinetic
            return
        self.turned = np.maximum(self.turned, np.maximum(kinetic, np.abs(potential - self.start)))
        made = total - self.level - tolerances.MADE * self.turned - tolerances.MADE_AT_REST
        if len(self.absurd) == len(made):
            made = np.where(self.absurd, 0.0, made)
        if made.max(initial=0.0) > 0.0:
            env = int(made.argmax())
            raise ImpossibleState(
                f"the mechanical energy of env {env} has grown from {self.level[env]:.4g} to {total[env]:.4g} J, and "
                f"nothing was done to it; {self.turned[env]:.3g} J were turned over"
            )


def undriven(world: World) -> bool:
    """Whether something moves by gravity and contacts alone: no drives, nothing absent, and no armature.

    The energy of armature is in no twist.
    """
    hidden = any(joint.armature > 0 or joint.mimic is not None for joint in world.joints)
    moves = any(body.kind is not BodyKind.STATIC for body in world.bodies)
    return moves and not (world.actuators or hidden or world.slots)


def energies(world: World, pose: Array, twist: Array) -> tuple[Array, Array]:
    """Kinetic and potential energy (N,) [J] of all that moves."""
    moving = [i for i, body in enumerate(world.bodies) if body.kind is not BodyKind.STATIC]
    parts = [world.bodies[i].inertial for i in moving]
    mass = np.array([part.mass for part in parts])
    arm = P.rotate(pose[:, moving, 3:], np.broadcast_to([part.com for part in parts], (len(pose), len(parts), 3)))
    rate = twist[:, moving, 3:]
    speed = twist[:, moving, :3] + P.cross(rate, arm)
    inner = P.rotate_inverse(pose[:, moving, 3:], rate)
    xx, yy, zz, xy, xz, yz = np.array([part.inertia for part in parts]).T
    x, y, z = np.moveaxis(inner, -1, 0)
    spin = xx * x * x + yy * y * y + zz * z * z + 2.0 * (xy * x * y + xz * x * z + yz * y * z)
    weightless = np.array([world.bodies[i].gravity_compensation for i in moving], dtype=bool)
    height = -((pose[:, moving, :3] + arm) @ np.array(world.physics.gravity))
    kinetic = 0.5 * (mass * (speed**2).sum(axis=-1) + spin)
    return kinetic.sum(axis=1), (np.where(weightless, 0.0, mass) * height).sum(axis=1)
