"""Markers on a patch that a tool passes: how many it has been at, and what that is worth."""

from math import ceil
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.contract import at_most
from anysim.task.references import Conditions
from anysim.task.scene import Frame, SceneView
from anysim_schemas.base import Positive


class Patch:
    """Markers in rows on a rectangle, about the origin of b in its x and y, and which of them a tool has been at."""

    def __init__(
        self,
        scene: SceneView,
        *,
        tool: Frame,
        b: Frame,
        size: Annotated[tuple[Positive, Positive], Field(description="of the rectangle [m]")],
        spacing: Annotated[float, Field(gt=0, description="of the markers at most [m]")] = 0.02,
        radius: Annotated[float, Field(gt=0, description="within which the tool passes a marker [m]")] = 0.02,
        during: Conditions | None = None,
    ) -> None:
        self._tool, self._base, self._radius, self._during = tool, b, radius, during
        sides = [(np.arange(count) + 0.5) / count - 0.5 for count in (ceil(side / spacing - 1e-9) for side in size)]
        grid = np.stack(np.meshgrid(*sides, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
        self._markers = grid * np.array([*size, 0.0])
        self._update = scene.memory(len(grid) + 1)  # which are covered, and what share of them is so since this step

    def covered(self) -> tuple[Array, Array]:
        """Share of the markers (n,) that the tool has been at, and share (n,) that it came to in this step."""
        now = self._update(self._pass)
        return now[:, :-1].mean(axis=1), now[:, -1]

    def _pass(self, before: Array, first: Array) -> Array:
        place = P.rotate_inverse(self._base.quaternion, self._tool.position - self._base.position)
        near = P.norm(self._markers - place[:, None]) <= self._radius
        if self._during is not None:
            near &= self._during.all()[:, None]
        covered = np.maximum(before[:, :-1], near)
        gain = covered.mean(axis=1) - before[:, :-1].mean(axis=1)
        return np.concatenate([covered, gain[:, None]], axis=1)


class Coverage(Patch):
    """A tool has been at so many markers in rows on a rectangle, about the origin of b in its x and y.

    A marker counts where the tool's origin comes within `radius` while all predicates of `during` hold, such as one of
    a force that is felt.
    """

    def __init__(
        self,
        scene: SceneView,
        *,
        share: Annotated[float, Field(gt=0, le=1, description="of the markers")] = 0.9,
        **patch: Any,
    ) -> None:
        super().__init__(scene, **patch)
        self._share = share

    def __call__(self) -> Array:
        return self.covered()[0] >= self._share


@at_most(1.0)
class CoverageGain(Patch):
    """Share of the markers on a patch that a tool has come to in this control step, as `coverage` counts them."""

    def __call__(self) -> Array:
        return self.covered()[1]
