"""The base of camera controllers: joints that are told where to be in each physics step, and rows that are kept."""

from collections.abc import Mapping

from anysim.controllers.base import ChannelView, Controller
from anysim.conventions import Array
from anysim_cameras.shake import Shake


class CameraController(Controller):
    """A controller that moves the joints of a channel in every physics step, from what it remembers of each env.

    Attributes:
        joints: of the channel's drives.
    """

    def __init__(self, channel: ChannelView, num_envs: int) -> None:
        super().__init__(channel, num_envs)
        world = channel.robot.world
        self.joints = tuple(world.joints[world.actuators[a].joint] for a in channel.actuators)
        self.period = self._dt = channel.robot.dt
        self._rows: dict[str, Array] = {}
        """What it remembers, a row for each env, by name."""

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        return {name: rows[env_ids] for name, rows in self._rows.items()}

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        for name, rows in self._rows.items():
            rows[env_ids] = data[name]


class HandHeld(CameraController):
    """One whose camera shakes as in a hand."""

    def __init__(self, channel: ChannelView, num_envs: int, shake: float, tremor: float) -> None:
        """`shake` and `tremor` are the amount and the pitch of `Shake`."""
        super().__init__(channel, num_envs)
        self._shake = Shake(channel, num_envs, shake, tremor)

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        return super().snapshot(env_ids) | self._shake.snapshot(env_ids)

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        super().restore(env_ids, data)
        self._shake.restore(env_ids, data)
