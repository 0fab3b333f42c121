"""The engine that the wrong ones are made from, and on which the same tests pass."""

from typing import ClassVar

import numpy as np

from anysim.engine.capability import Capabilities, Capability, Support
from anysim.testing.kinematic import NullEngine


def also(*capabilities: Capability) -> Capabilities:
    """What the null engine declares, and more."""
    return Capabilities({**NullEngine.capabilities.supported, **{c: Support() for c in capabilities}})


class Right(NullEngine):
    """Nothing is wrong with it: the null engine, and wrenches that push free bodies of even inertia."""

    capabilities = also(Capability.WRENCHES)
    caught_by: ClassVar[tuple[str, ...]] = ()

    def _build(self, world, num_envs):
        super()._build(world, num_envs)
        self._wrench = None
        # what has no mass is fixed and does not move
        self._mass = np.array([b.inertial.mass or np.inf for b in world.bodies])[:, None]
        self._moment = np.array([b.inertial.inertia[0] or np.inf for b in world.bodies])[:, None]

    def _apply_wrench(self, wrench):
        self._wrench = None if wrench is None else wrench.copy()

    def _step(self, n_steps, ids):
        rows = self._all if ids is None else ids
        for _ in range(n_steps):
            if self._wrench is not None:
                push = self._wrench[rows] * self.world.physics.dt
                self._envs.twists[rows, :, :3] += push[..., :3] / self._mass
                self._envs.twists[rows, :, 3:] += push[..., 3:] / self._moment
            super()._step(1, ids)
