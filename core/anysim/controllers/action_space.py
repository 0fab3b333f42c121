"""The action of all robots together: one flat vector, or an array for each channel by its name."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from anysim.controllers.base import Controller
from anysim.conventions import Array
from anysim.errors import TaskError, listing, suggest
from anysim.math.arrays import numbers


class ChannelSpace(NamedTuple):
    """What the controller of a channel takes.

    Attributes:
        low, high: bounds (k,), in the controller's units.
        labels: the name of each component.
        start, stop: its columns in the flat action.
    """

    low: Array
    high: Array
    labels: tuple[str, ...]
    start: int
    stop: int

    @property
    def dim(self) -> int:
        """The number of components k."""
        return self.stop - self.start


class ActionSpaces(Mapping[str, ChannelSpace]):
    """The channels by `robot.channel`, in the order of the flat action: robots, then the channels of each."""

    def __init__(self, channels: Mapping[str, ChannelSpace]) -> None:
        self._channels = dict(channels)
        self.dim = sum(space.dim for space in self._channels.values())
        """Components A of the flat action."""

    def __getitem__(self, name: str) -> ChannelSpace:
        if name not in self._channels:
            raise TaskError(self._unknown(name))
        return self._channels[name]

    def get(self, name: str, default: Any = None) -> Any:
        return self._channels.get(name, default)

    def __contains__(self, name: object) -> bool:
        return name in self._channels

    def __iter__(self) -> Iterator[str]:
        return iter(self._channels)

    def __len__(self) -> int:
        return len(self._channels)

    def _unknown(self, name: object) -> str:
        known = list(self._channels)
        return f"no channel '{name}' takes an action{suggest(str(name), known)} (channels: {listing(known, 20)})"

    @property
    def labels(self) -> tuple[str, ...]:
        """The name of each of the A components, as `panda.arm.panda_joint1`."""
        return tuple(f"{name}.{label}" for name, space in self._channels.items() for label in space.labels)

    def flatten(self, named: Mapping[str, Any], rows: int) -> Array:
        """The flat action (N, A) of an array (N, k) for each channel.

        Raises:
            TaskError: a channel is unknown or missing, or an array has another shape than (`rows`, k).
        """
        for name in named:
            if name not in self._channels:
                raise TaskError(self._unknown(name))
        missing = [f"'{name}'" for name in self._channels if name not in named]
        if missing:
            raise TaskError(
                f"the action has nothing for {listing(missing, 20)}; give every channel an "
                f"array, or pass the flat action of {self.dim} components"
            )
        flat = np.empty((rows, self.dim))
        for name, space in self._channels.items():
            part = numbers(f"the action of '{name}'", named[name], TaskError)
            if part.shape != (rows, space.dim):
                words = listing(list(space.labels), 20)
                raise TaskError(
                    f"the action of '{name}' must have shape ({rows}, {space.dim}), got {part.shape}; "
                    f"its components: {words}"
                )
            flat[:, space.start : space.stop] = part
        return flat

    def unflatten(self, flat: Array) -> dict[str, Array]:
        """Copies of the parts (..., k) of a flat action (..., A), by channel."""
        array = np.asarray(flat)
        if array.shape[-1:] != (self.dim,):
            raise TaskError(f"a flat action has {self.dim} components in its last axis, got shape {array.shape}")
        return {name: array[..., space.start : space.stop].copy() for name, space in self._channels.items()}


def component_labels(controller: Controller, joints: Sequence[str]) -> tuple[str, ...]:
    """What the components of a controller's action are called: its own labels, else the channel's joints, else numbers.

    Raises:
        TaskError: the controller has another number of labels than components.
    """
    if controller.labels:
        if len(controller.labels) != controller.dim:
            raise TaskError(
                f"{type(controller).__name__} has {len(controller.labels)} labels for {controller.dim} components"
            )
        return tuple(controller.labels)
    if controller.dim == len(joints):
        return tuple(joints)
    return tuple(str(i) for i in range(controller.dim))
