"""The contract of a controller: one channel, one slice of the action, targets for the channel's drives."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from anysim.conventions import Array
from anysim.world.model import Channel, World


@dataclass(frozen=True)
class ChannelView:
    """What a controller knows of its channel. Arrays have one entry for each drive (K,).

    `columns` is what `targets[:, columns]` needs to address the drives: a slice where they are contiguous.
    """

    name: str
    actuators: Array
    columns: slice | Array
    lower: Array
    upper: Array
    velocity_limit: Array
    opened: Array | None
    closed: Array | None

    @classmethod
    def of(cls, world: World, channel: Channel) -> Self:
        """The view of a channel of a World."""
        drives = np.array(channel.actuators, dtype=int)
        joints = [world.joints[world.actuators[a].joint] for a in channel.actuators]
        contiguous = len(drives) > 0 and (np.diff(drives) == 1).all()
        columns = slice(int(drives[0]), int(drives[-1]) + 1) if contiguous else drives
        ends = [
            None if v is None else np.array(v[: len(drives)], dtype=float) for v in (channel.opened, channel.closed)
        ]
        return cls(
            channel.name, drives, columns,
            np.array([j.lower for j in joints]), np.array([j.upper for j in joints]),
            np.array([j.velocity_limit for j in joints]), ends[0], ends[1],
        )  # fmt: skip


class Controller(ABC):
    """Turns actions into position targets. Keyword-only arguments of a subclass's `__init__` are its YAML parameters.

    Attributes:
        dim: the number of action components.
        low, high: their bounds (dim,).
    """

    dim: int
    low: Array
    high: Array

    def __init__(self, channel: ChannelView, num_envs: int) -> None:
        self.channel = channel
        self.num_envs = num_envs

    def reset(self, env_ids: Array, targets: Array) -> None:
        """The drives of these envs hold `targets` (E, K) now."""

    @abstractmethod
    def apply(self, action: Array, env_ids: Array | None) -> Array:
        """Position targets (E, K) for actions (E, dim) of all envs, or of `env_ids`."""

    @abstractmethod
    def action_for(self, targets: Array, env_ids: Array) -> Array:
        """The action (E, dim), within its bounds, that brings the drives nearest to targets (E, K) in one step."""

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        """Copies of the controller's own state."""
        return {}

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        """Write what `snapshot` returned."""
