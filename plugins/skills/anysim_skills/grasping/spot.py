"""A spot on something: a frame that is moved aside from another one."""

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.scene import Frame


class Spot(Frame):
    """The frame `of`, moved by (x, y) [m] along its own axes; it has the name of `of`, which it is a part of."""

    def __init__(self, of: Frame, x: float, y: float) -> None:
        super().__init__(of.scene, of.name)
        self._of, self._shift = of, np.array([[x, y, 0.0, 0.0, 0.0, 0.0, 1.0]])

    @property
    def present(self) -> Array:
        return self._of.present

    def _compute(self) -> Array:
        return P.compose(self._of.pose, self._shift)
