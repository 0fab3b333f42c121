"""Parts that the controllers of vehicles share: their drives by role, and limits of acceleration."""

from collections.abc import Mapping, Sequence
from typing import TypeVar

import numpy as np

from anysim.controllers.base import ChannelView
from anysim.conventions import Array
from anysim.errors import TaskError, listing
from anysim.model.world import ControlMode

V = TypeVar("V")


def vehicle_of(channel: ChannelView, kind: type[V], controller: str) -> V:
    """The robot's vehicle.

    Raises:
        TaskError: it has none, or one of another kind.
    """
    entry = channel.robot.entry
    if isinstance(entry.vehicle, kind):
        return entry.vehicle
    has = f"has a vehicle of kind {entry.vehicle.kind}" if entry.vehicle is not None else "has no `vehicle`"
    suited = entry.channels[channel.name].controllers
    remedy = f"suited to its channel '{channel.name}': {listing(suited)}" if suited else "choose another controller"
    raise TaskError(f"{controller} does not drive '{entry.name}', whose catalogue entry {has}; {remedy}")


class Drives:
    """A channel's drives in the parts of a vehicle: steered ones take positions, wheels take velocities.

    Other joints of the channel hold the positions of the last reset.
    """

    def __init__(self, channel: ChannelView, num_envs: int, steered: Sequence[str], wheels: Sequence[str]) -> None:
        entry = channel.robot.entry
        place = {name: i for i, name in enumerate(entry.channels[channel.name].joints)}
        missing = [name for name in (*steered, *wheels) if name not in place]
        if missing:
            raise TaskError(
                f"the vehicle of '{entry.name}' has {listing(missing)}, which the channel '{channel.name}' has not; "
                "give the controller to the channel that has all joints of the vehicle"
            )
        self.steered = np.array([place[name] for name in steered], dtype=int)
        self.wheels = np.array([place[name] for name in wheels], dtype=int)
        self.modes = tuple(
            ControlMode.VELOCITY if i in self.wheels else ControlMode.POSITION for i in range(len(channel))
        )
        self._held = np.zeros((num_envs, len(channel)))
        self._still = np.zeros((num_envs, len(channel)))

    def reset(self, env_ids: Array, targets: Array) -> None:
        """Hold targets (E, K)."""
        self._held[env_ids] = targets

    def positions(self, env_ids: Array | None, steered: Array | None = None) -> Array:
        """(E, K) for all drives: steered ones (E, S) as given, the others as held."""
        all = self._held[rows_of(env_ids)].copy()
        if steered is not None:
            all[:, self.steered] = steered
        return all

    def velocities(self, env_ids: Array | None, wheels: Array) -> Array:
        """(E, K) for all drives: wheels (E, W) as given, 0 for the others."""
        all = self._still[rows_of(env_ids)].copy()
        all[:, self.wheels] = wheels
        return all

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        return {"held": self._held[env_ids]}

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        self._held[env_ids] = data["held"]


class Ramp:
    """A command that moves no faster than its rates allow, in a straight line to what is wanted.

    The components keep their proportions on the way: a base that goes faster does not leave its circle.
    """

    def __init__(self, num_envs: int, rates: Sequence[float], dt: float) -> None:
        self.now = np.zeros((num_envs, len(rates)))
        self._steps = np.array(rates, dtype=float) * dt

    def reset(self, env_ids: Array) -> None:
        """Begin at rest."""
        self.now[env_ids] = 0.0

    def toward(self, wanted: Array, env_ids: Array | None) -> Array:
        """(E, C) of one control step towards wanted (E, C)."""
        rows = rows_of(env_ids)
        way = wanted - self.now[rows]
        part = np.minimum(1.0, 1.0 / np.maximum((np.abs(way) / self._steps).max(axis=1), 1e-12))
        # what is reached is reached exactly
        self.now[rows] = np.where(part[:, None] < 1.0, self.now[rows] + part[:, None] * way, wanted)
        return self.now[rows].copy()


def rows_of(env_ids: Array | None) -> slice | Array:
    """What addresses the rows of these envs."""
    return slice(None) if env_ids is None else env_ids


def bound(given: float | None, most: float, what: str, robot: str) -> float:
    """The given bound of an action, or the most that the wheels allow.

    Raises:
        TaskError: neither is known.
    """
    if given is not None:
        return given
    if not np.isfinite(most):
        raise TaskError(
            f"the wheels of '{robot}' have no limits of speed, so that `{what}` has no bound; give `{what}` here or in "
            "the `controllers` of the catalogue entry"
        )
    return float(most)
