"""Cameras of all envs: the contract turns mounts and poses into world poses, and an engine only draws."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from anysim.conventions import Array
from anysim.engine.arguments import named
from anysim.errors import EngineError
from anysim.math import pose as P
from anysim.math.arrays import whole
from anysim.model.index import Index, paired
from anysim.model.world import Camera, World

LARGEST = 8192
"""Pixels along an edge of an image."""


@dataclass(frozen=True)
class CameraView:
    """What an engine needs to draw.

    Attributes:
        name: of the camera.
        pose: (E, 7) world poses of the optical frame.
        fov: (E,) vertical fields of view [degrees].
        body_pose: (E, B, 7) where all bodies are drawn: as they are now, or as they once were.
        width, height: of the image [px].
        near, far: what is nearer or farther is not seen [m].
    """

    name: str
    pose: Array
    fov: Array
    body_pose: Array
    width: int
    height: int
    near: float
    far: float

    def blank(self, channels: Sequence[str]) -> dict[str, Array]:
        """Images (E, H, W, ...) of these channels, to be drawn into."""
        return blank_images((len(self.pose), self.height, self.width), channels)


def blank_images(size: tuple[int, int, int], channels: Sequence[str]) -> dict[str, Array]:
    """Images of nothing by channel: `size` is (E, H, W)."""
    kinds = {"rgb": ((*size, 3), np.uint8), "depth": (size, np.float32), "segmentation": (size, np.int32)}
    return {name: np.zeros(*kinds[name]) for name in channels}


class CameraRig:
    """The cameras of a world in all envs, each its own: poses relative to their bodies, and vertical fields of view.

    Attributes:
        poses: (N, C, 7).
        fov: (N, C) [degrees].
    """

    def __init__(self, world: World, num_envs: int) -> None:
        self.world = world
        mounts = [[*c.position, *c.quaternion] for c in world.cameras]
        self.poses = np.tile(np.array(mounts, dtype=float).reshape(1, -1, 7), (num_envs, 1, 1))
        self.fov = np.tile(np.array([c.fov for c in world.cameras], dtype=float), (num_envs, 1))

    def carry(self, old: "CameraRig") -> None:
        """Take over poses and fields of view of the cameras that another rig has by name."""
        before, after = paired(old.world, self.world, "cameras")
        self.poses[:, after] = old.poses[:, before]
        self.fov[:, after] = old.fov[:, before]

    def view(
        self, name: str, index: Index, body_pose: Array, ids: Array, width: int | None, height: int | None
    ) -> CameraView:
        """The camera by name where bodies have the poses (E, B, 7) in the envs `ids`.

        `default` is an overview unless a camera has that name.
        """
        names = [c.name for c in self.world.cameras]
        if named("camera", name) == "default" and name not in names:
            camera = self._overview()
            local = np.tile([*camera.position, *camera.quaternion], (len(ids), 1))
            fov = np.full(len(ids), camera.fov)
        else:
            number = index.camera(name)
            camera = self.world.cameras[number]
            local, fov = self.poses[ids, number], self.fov[ids, number]
        pose = local if camera.body < 0 else P.compose(body_pose[:, camera.body], local)
        wide, high = camera.width if width is None else width, camera.height if height is None else height
        size = (whole("width", wide, EngineError, 1, LARGEST + 1), whole("height", high, EngineError, 1, LARGEST + 1))
        return CameraView(name, pose, fov, body_pose, *size, camera.near, camera.far)

    def _overview(self) -> Camera:
        """Looks at the middle of all bodies' initial places, from far enough to see them."""
        places = self.world.initial_body_pose[:, :3] if self.world.bodies else np.zeros((1, 3))
        middle = (places.min(axis=0) + places.max(axis=0)) / 2
        reach = max(1.0, float(np.linalg.norm(places - middle, axis=1).max()) * 2.5)
        eye = middle + reach * np.array([0.75, -0.75, 0.55])
        quaternion = P.look_at(eye, middle)
        return Camera("default", -1, tuple(eye), tuple(quaternion), 50.0, 640, 480, far=max(20.0, 4 * reach))
