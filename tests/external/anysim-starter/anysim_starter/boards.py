"""Models of boards, a line each: a name and two opposite corners [m]. An importer, and an independent reader."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from anysim.assets.bounded_files import bounded
from anysim.assets.model import ImportedModel
from anysim.conventions import Array
from anysim.errors import AssetError
from anysim.math import pose as P
from anysim_assets.assembly import Assembly
from anysim_schemas.limits import MODEL_BYTES

DENSITY = 600.0
"""[kg/m^3] of all boards."""


def import_boards(path: Path, *, root: Path, scale: float, visual_error: float) -> ImportedModel:
    """The model of a file, one body.

    Raises:
        AssetError: a line that is no board, or no line at all.
    """
    del root, visual_error  # the file refers to no other, and boxes are seen as they are
    body = Assembly(path.stem)
    lines = bounded(path, MODEL_BYTES).decode("utf-8", "replace").splitlines()
    for number, line in enumerate(lines, 1):
        name, *words = line.split()
        try:
            low, high = np.array([float(word) for word in words]).reshape(2, 3) * scale
        except ValueError:
            raise AssetError(f"{path}:{number}: expected a name and six numbers, as in `top 0 0 0 1 1 0.02`") from None
        body.board(0, name, tuple(low.tolist()), tuple(high.tolist()), DENSITY, "beige")
    if not lines:
        raise AssetError(f"{path} has no boards; write one a line")
    return body.model()


class BoardsOracle:
    """What a file says, worked out with nothing of the importer: an `Oracle` of anysim-robots."""

    name = "the starter's table of corners"
    joints = 0
    root = "base"

    def __init__(self, path: Path, root: Path, body: str = "") -> None:
        del root, body
        corners = np.loadtxt(path, usecols=range(1, 7), ndmin=2)
        self.mass = DENSITY * float(np.abs(corners[:, 3:] - corners[:, :3]).prod(axis=1).sum())
        self.followers: Mapping[str, object] = {}

    def frames(self, joint_pos: Mapping[str, float]) -> Mapping[str, Array]:
        """Its one link, at the origin."""
        del joint_pos
        return {self.root: P.pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))}
