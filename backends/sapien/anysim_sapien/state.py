"""Reads of the neutral state from the scenes of all envs."""

from collections.abc import Callable, Mapping

import numpy as np

from anysim.conventions import Array
from anysim.model.world import World
from anysim_mechanics.link_twists import LinkTwists
from anysim_sapien.packing import Batch
from anysim_sapien.scene import EnvScene


class StateReader:
    """Fields of all envs at once, from what their scenes pack."""

    def __init__(self, world: World, scenes: list[EnvScene]) -> None:
        self._scenes, self._twists = scenes, LinkTwists(world)
        self._blobs: list[bytes] = []
        self._packed, self._batch = np.zeros(0), Batch([scene.packing for scene in scenes])
        self._coms: list[Array] = []
        self._com = np.zeros((len(scenes), len(world.bodies), 3))
        self.fields: Mapping[str, Callable[[], Array]] = {
            "body_pose": lambda: self._taken("pose"),
            "body_twist": self.body_twist,
            "joint_pos": lambda: self._taken("joint_pos"),
            "joint_vel": lambda: self._taken("joint_vel"),
            "fault": self.fault,
        }
        """Reads a fresh array of a field."""

    def _read(self) -> tuple[Array, Batch]:
        """What all scenes say now, one after the other, and where it is."""
        blobs, packings = [scene.packed() for scene in self._scenes], [scene.packing for scene in self._scenes]
        if packings != self._batch.packings:
            self._batch, self._blobs = Batch(packings), []  # the same bytes may be of other bodies
        if blobs != self._blobs:
            self._packed = np.frombuffer(b"".join(blobs), dtype=np.float32).astype(float)
            assert self._packed.size == self._batch.start[-1], "a scene has other parts than its recipe says"
            self._blobs = blobs
        return self._packed, self._batch

    def _taken(self, name: str) -> Array:
        packed, batch = self._read()
        return packed.take(getattr(batch, name))

    def body_twist(self) -> Array:
        coms = [scene.com for scene in self._scenes]
        if len(coms) != len(self._coms) or any(a is not b for a, b in zip(coms, self._coms, strict=True)):
            self._coms, self._com = coms, np.array(coms)
        packed, batch = self._read()
        pose, velocity, joint_vel = (packed.take(at) for at in (batch.pose, batch.velocity, batch.joint_vel))
        return self._twists.of(pose, velocity, joint_vel, self._com)

    def fault(self) -> Array:
        packed, batch = self._read()
        finite = np.isfinite(packed)
        if finite.all():
            return np.zeros(len(self._scenes), dtype=bool)
        return ~np.logical_and.reduceat(finite, batch.start[:-1])
