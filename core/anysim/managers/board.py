"""What one manager decides about the present episodes and others need to know. Each array has one writer."""

import numpy as np


class Board:
    """Attributes of all envs.

    Attributes:
        origin: (N, 3) [m] where an env's scene stands on the ground; the terrain manager writes it.
    """

    def __init__(self, num_envs: int) -> None:
        self.origin = np.zeros((num_envs, 3))
