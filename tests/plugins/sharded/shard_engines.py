"""Engines that misbehave on purpose, in a module that worker processes can import."""

import os
import signal
import time

from anysim.errors import CapabilityError
from anysim.testing.kinematic import NullEngine


class Moody(NullEngine):
    """Does what the position target of env 0 of its block says in the next step."""

    def _step(self, n_steps, ids):
        assert self._envs.control is not None
        wish = int(self._envs.control.position[0, 0])
        if wish == 1:
            os.kill(os.getpid(), signal.SIGSEGV)
        elif wish == 2:
            time.sleep(60.0)
        elif wish == 3:
            raise ZeroDivisionError("no way")
        elif wish == 4:
            raise CapabilityError("env 0 cannot do that")
        elif wish == 5:
            os._exit(7)
        elif wish == 6:
            time.sleep(1.5)
        super()._step(n_steps, ids)


class Unbuildable(NullEngine):
    """Its second block of envs cannot be built, because there are fewer of them."""

    def _build(self, world, num_envs):
        if num_envs < 3:
            raise CapabilityError("too few envs for me")
        super()._build(world, num_envs)


class Unborn(NullEngine):
    """Its process ends while it builds."""

    def _build(self, world, num_envs):
        os._exit(3)


class Fragile(NullEngine):
    """Its process ends when it is asked for a parameter."""

    def _get_parameter(self, name):
        os._exit(4)


class Balks(NullEngine):
    """Its process ends when it has to build a world with a crate in it."""

    def _build(self, world, num_envs):
        if any(entity.name == "crate" for entity in world.entities):
            os._exit(5)
        super()._build(world, num_envs)
