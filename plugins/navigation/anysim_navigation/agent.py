"""The agent that a map is made for: a disc with a height that moves over the ground."""

from typing import NamedTuple

import numpy as np

from anysim.errors import AnysimError


class NoRoute(AnysimError):
    """There is no way, with the reason."""


class Agent(NamedTuple):
    """A disc that moves over the ground, and what it gets over and under.

    Attributes:
        radius: [m] no point of a way is nearer than this to anything.
        height: [m] what begins higher is passed under.
        step: [m] what is lower is driven or stepped over.
        slope: [rad] the steepest ground that it goes up.
    """

    radius: float = 0.3
    height: float = 1.2
    step: float = 0.03
    slope: float = float(np.deg2rad(20.0))

    def check(self) -> None:
        """Look for what no map can be made for.

        Raises:
            AnysimError: a size that is not positive, or a step as high as the agent.
        """
        if not (self.radius > 0 and 0 <= self.step < self.height and 0 <= self.slope < np.pi / 2):
            raise AnysimError(
                f"an agent of radius {self.radius:g} m, height {self.height:g} m, step {self.step:g} m and slope "
                f"{self.slope:g} rad: expected a radius above 0, a step from 0 to below the height, a slope below pi/2"
            )
