"""Pictures of one env for a person, with points of what the simulator measures drawn into them."""

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim_legged_gym.build import VIEWER
from anysim_legged_gym.ground import BESIDE, Ground
from anysim_legged_gym.moment import Moment
from anysim_legged_gym.spec import ViewerSpec

HEIGHTS, FEET, KEYS = (255, 210, 0), (0, 220, 255), (255, 0, 160)
"""Colours, red green blue."""


class Viewer:
    """A camera that looks at one env.

    Attributes:
        image: (H, W, 3) uint8, the last picture; None before the first.
    """

    def __init__(self, engine: SimEngine, ground: Ground, spec: ViewerSpec) -> None:
        self._engine, self._ground, self._spec = engine, ground, spec
        self.image: Array | None = None
        if not spec.headless:
            origin = ground.env_origins[spec.env]
            self.look(origin + spec.eye, origin + spec.target)

    def look(self, eye: object, target: object) -> None:
        """Put the camera at `eye`, towards `target`, both (3,) [m], world frame.

        Raises:
            TaskError: there is none, or they are no two places.
        """
        self._require()
        here, there = np.asarray(eye, dtype=float), np.asarray(target, dtype=float)
        if here.shape != (3,) or there.shape != (3,) or np.linalg.norm(there - here) < 1e-6:
            raise TaskError(f"eye and target are two places of three numbers [m], got {eye} and {target}")
        pose = np.concatenate([here, P.look_at(here, there)])
        self._engine.set_camera_pose(VIEWER, pose[None], [self._spec.env])

    def _require(self) -> None:
        if self._spec.headless:
            raise TaskError("this simulator has no viewer; make it with `viewer: {headless: false}`")

    def draw(self, moment: Moment, depth: Array | None) -> Array:
        """A picture of now, with all that is asked for.

        `depth` is the depth image of the env.
        """
        self._require()
        spec, ids = self._spec, [self._spec.env]
        picture = self._engine.render(VIEWER, env_ids=ids)["rgb"][0].copy()
        view = self._engine.camera_view(VIEWER, ids)
        pose, focal = view.pose[0], picture.shape[0] / (2 * np.tan(np.radians(float(np.ravel(view.fov)[0])) / 2))
        for points, color in self._points(moment):
            _mark(picture, points, pose, focal, color)
        if spec.debug_draw_depth_images and depth is not None:
            _inset(picture, depth)
        self.image = picture
        return picture

    @property
    def marks(self) -> bool:
        """Whether anything is drawn into pictures."""
        spec = self._spec
        return not spec.headless and (
            spec.debug_draw_height_points_around_base
            or spec.debug_draw_height_points_around_feet
            or spec.debug_draw_key_body_points
            or spec.debug_draw_depth_images
        )

    def _points(self, moment: Moment) -> list[tuple[Array, tuple[int, int, int]]]:
        spec, env = self._spec, self._spec.env
        found: list[tuple[Array, tuple[int, int, int]]] = []
        yaw = P.to_roll_pitch_yaw(moment.base_quat[env])[2]
        if spec.debug_draw_height_points_around_base:
            beside = _turned(self._ground.points, yaw) + moment.base_pos[env, :2]
            found.append((np.column_stack([beside, moment.measured_heights[env]]), HEIGHTS))
        if spec.debug_draw_height_points_around_feet:
            beside = moment.feet[0][env, :, None, :2] + _turned(BESIDE, yaw)
            heights = moment.heights_around_feet[env]
            found.append((np.concatenate([beside, heights[..., None]], axis=-1).reshape(-1, 3), FEET))
        if spec.debug_draw_key_body_points:
            found.append((np.concatenate([moment.key_body_pos[env], moment.feet[0][env]]), KEYS))
        return found


def _turned(points: Array, yaw: float) -> Array:
    c, s = np.cos(yaw), np.sin(yaw)
    return points @ np.array([[c, s], [-s, c]])


def _mark(picture: Array, points: Array, pose: Array, focal: float, color: tuple[int, int, int]) -> None:
    """Draw discs of 2 pixels at points (K, 3) [m], world frame; what is behind something is drawn too."""
    height, width = picture.shape[:2]
    local = P.rotate_inverse(pose[3:], points - pose[:3])
    local = local[local[:, 2] > 1e-3]
    columns = np.rint(width / 2 - 0.5 + focal * local[:, 0] / local[:, 2]).astype(int)
    rows = np.rint(height / 2 - 0.5 + focal * local[:, 1] / local[:, 2]).astype(int)
    for dx, dy in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)):
        x, y = columns + dx, rows + dy
        inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        picture[y[inside], x[inside]] = color


def _inset(picture: Array, depth: Array) -> None:
    """Draw a depth image into the upper left corner, near things bright."""
    span = max(float(np.ptp(depth)), 1e-6)
    grey = (255 * (1 - (depth - depth.min()) / span)).astype(np.uint8)
    grey = grey[: picture.shape[0], : picture.shape[1]]
    picture[: grey.shape[0], : grey.shape[1]] = grey[..., None]
