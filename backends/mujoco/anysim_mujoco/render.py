"""Images: the scene of each env, drawn from any camera pose into one offscreen buffer."""

from math import radians, tan
from typing import Any

import mujoco
import numpy as np

from anysim.conventions import Array
from anysim.engine.cameras import CameraView
from anysim.math import pose as P
from anysim_mujoco.geoms import DRAWN_GROUPS
from anysim_mujoco.gl import gl_thread
from anysim_mujoco.layout import Layout
from anysim_mujoco.options import MujocoOptions
from anysim_mujoco.query import Queries

_SEGMENT, _ID_COLOR = int(mujoco.mjtRndFlag.mjRND_SEGMENT), int(mujoco.mjtRndFlag.mjRND_IDCOLOR)


class Painter:
    """Draws the envs of one engine. Its methods may be called from any thread."""

    def __init__(self, model: Any, layout: Layout, queries: Queries, options: MujocoOptions) -> None:
        self._thread = gl_thread()
        self._thread.open(options.gl)
        self._layout, self._queries = layout, queries
        self._scene = mujoco.MjvScene(model, maxgeom=model.ngeom + 16)
        self._options = mujoco.MjvOption()
        self._options.geomgroup[:] = 0
        self._options.geomgroup[list(DRAWN_GROUPS)] = 1
        self._free_camera = mujoco.MjvCamera()
        self._size = (64, 64)
        model.vis.global_.offwidth, model.vis.global_.offheight = self._size
        self._context: Any = self._thread.call(lambda: _make_context(model))

    def close(self) -> None:
        """Free the GPU's copies of the model."""
        context, self._context = self._context, None
        if context is not None:
            self._thread.call(context.free)

    def draw(self, view: CameraView, ids: Array, channels: tuple[str, ...]) -> dict[str, Array]:
        """See `SimEngine.render`."""
        return self._thread.call(lambda: self._draw(view, ids, channels))

    def _draw(self, view: CameraView, ids: Array, channels: tuple[str, ...]) -> dict[str, Array]:
        self._fit(view.width, view.height)
        # another engine's painter may have drawn in between, into buffers of its own
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        size = (len(ids), view.height, view.width)
        shapes: dict[str, tuple[tuple[int, ...], Any]] = {
            "rgb": ((*size, 3), np.uint8), "depth": (size, np.float32), "segmentation": (size, np.int32)
        }  # fmt: skip
        images = {name: np.empty(*shapes[name]) for name in channels}
        axes = P.to_matrix(view.pose[:, 3:])
        rect = mujoco.MjrRect(0, 0, view.width, view.height)
        colors = np.empty((view.height, view.width, 3), dtype=np.uint8)
        for row, index in enumerate(ids):
            self._compose(int(index), view, view.pose[row, :3], axes[row])
            if "rgb" in images:
                mujoco.mjr_render(rect, self._scene, self._context)
                mujoco.mjr_readPixels(colors, None, rect, self._context)
                images["rgb"][row] = colors[::-1]
            if "depth" in images or "segmentation" in images:
                self._measure(view, rect, colors, images, row)
        return images

    def _fit(self, width: int, height: int) -> None:
        """Grow the offscreen buffer to the largest image asked for so far."""
        grown = (max(width, self._size[0]), max(height, self._size[1]))
        if grown != self._size:
            mujoco.mjr_resizeOffscreen(*grown, self._context)
            self._size = grown

    def _compose(self, index: int, view: CameraView, eye: Array, axes: Array) -> None:
        """Put the geoms of an env and the camera into the scene."""
        model, data = self._queries.env(index)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_camlight(model, data)
        everything = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(model, data, self._options, None, self._free_camera, everything, self._scene)
        top = view.near * tan(radians(view.fov) / 2)
        for camera in self._scene.camera:
            camera.pos, camera.forward, camera.up = eye, axes[:, 2], -axes[:, 1]
            camera.frustum_center = 0.0
            camera.frustum_bottom, camera.frustum_top = -top, top
            camera.frustum_near, camera.frustum_far = view.near, view.far

    def _measure(self, view: CameraView, rect: Any, colors: Array, images: dict[str, Array], row: int) -> None:
        """Depth and segmentation, from one pass in which a geom's colour is its number in the scene plus one."""
        scene = self._scene
        scene.flags[_SEGMENT] = scene.flags[_ID_COLOR] = 1
        raw = np.empty((view.height, view.width), dtype=np.float32) if "depth" in images else None
        mujoco.mjr_render(rect, scene, self._context)
        mujoco.mjr_readPixels(colors if "segmentation" in images else None, raw, rect, self._context)
        scene.flags[_SEGMENT] = scene.flags[_ID_COLOR] = 0
        if raw is not None:
            images["depth"][row] = _metres(raw[::-1], view.near, view.far)
        if "segmentation" in images:
            entities = np.zeros(scene.ngeom + 1, dtype=np.int32)
            for geom in scene.geoms[: scene.ngeom]:
                if geom.segid >= 0 and geom.objtype == mujoco.mjtObj.mjOBJ_GEOM:
                    entities[geom.segid + 1] = self._layout.geom_entity[geom.objid]
            code = colors[::-1].astype(np.int32)
            images["segmentation"][row] = entities[code[..., 0] + 256 * code[..., 1] + 65536 * code[..., 2]]


def _make_context(model: Any) -> Any:
    context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50.value)
    mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, context)
    context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
    return context


def _metres(raw: Array, near: float, far: float) -> Array:
    """Distance along the optical axis from a reversed depth buffer: 1 at the near plane, 0 from the far one on."""
    inverse = 1 / far + raw.astype(np.float64) * (1 / near - 1 / far)
    return np.where(raw > 0, 1 / inverse, np.inf).astype(np.float32)
