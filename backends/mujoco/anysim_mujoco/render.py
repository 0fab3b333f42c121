"""Images: the scene of each env, drawn from any camera pose into one offscreen buffer."""

from math import radians, tan
from typing import Any

import mujoco
import numpy as np

from anysim.conventions import Array, wxyz_from_xyzw
from anysim.engine.cameras import CameraView
from anysim.engine.lighting import Look, Looks
from anysim.math import pose as P
from anysim_mujoco.geoms import DRAWN_GROUPS, SHINE, shadow_place
from anysim_mujoco.gl import gl_thread
from anysim_mujoco.layout import Layout
from anysim_mujoco.options import MujocoOptions
from anysim_mujoco.query import Queries

_SHADOW = int(mujoco.mjtRndFlag.mjRND_SHADOW)
_GROUND = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))
_UNSHADING = int(mujoco.mjtCatBit.mjCAT_DECOR)
_SEGMENT, _ID_COLOR = int(mujoco.mjtRndFlag.mjRND_SEGMENT), int(mujoco.mjtRndFlag.mjRND_IDCOLOR)
AROUND = 6.0
"""[m] What the shadow map of a light from far away shows at least to each side of the bodies, and before them."""


class Painter:
    """Draws the envs of one engine. Its methods may be called from any thread."""

    def __init__(self, model: Any, layout: Layout, queries: Queries, looks: Looks, options: MujocoOptions) -> None:
        self._thread = gl_thread()
        self._thread.open(options.gl)
        self._layout, self._queries, self._looks = layout, queries, looks
        self._model, self._sky = model, Sky(model)
        self._scene = mujoco.MjvScene(model, maxgeom=model.ngeom + 16)
        self._options = mujoco.MjvOption()
        self._options.geomgroup[:] = 0
        self._options.geomgroup[list(DRAWN_GROUPS)] = 1
        self._free_camera = mujoco.MjvCamera()
        self._size = (64, 64)
        model.vis.global_.offwidth, model.vis.global_.offheight = self._size
        model.vis.quality.offsamples = options.samples(self._thread.in_software())
        self._frames = Frames(model, layout)
        self._context: Any = self._thread.call(lambda: _make_context(model))
        self._widest = float(self._context.shadowClip)

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
        images = view.blank(channels)
        axes = P.to_matrix(view.pose[:, 3:])
        rect = mujoco.MjrRect(0, 0, view.width, view.height)
        colors = np.empty((view.height, view.width, 3), dtype=np.uint8)
        for row, index in enumerate(ids):
            self._compose(int(index), view, row, axes[row])
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

    def _compose(self, index: int, view: CameraView, row: int, axes: Array) -> None:
        """Put the geoms and lights of an env and the camera into the scene."""
        model = self._queries.model(index)
        data = self._frames.placed(model, view.body_pose[row])
        everything = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(model, data, self._options, None, self._free_camera, everything, self._scene)
        look = self._looks.of(index)
        self._shine(look)
        if look.shadows:
            self._shade(look, view.body_pose[row, :, :3], view.far)
        eye, top = view.pose[row, :3], view.near * tan(radians(view.fov[row]) / 2)
        for camera in self._scene.camera:
            camera.pos, camera.forward, camera.up = eye, axes[:, 2], -axes[:, 1]
            camera.frustum_center = 0.0
            camera.frustum_bottom, camera.frustum_top = -top, top
            camera.frustum_near, camera.frustum_far = view.near, view.far

    def _shine(self, look: Look) -> None:
        """Give the scene the lights and the sky of an env. Its first light is the viewer's own lamp."""
        lamp, *lights = list(self._scene.lights)[: self._scene.nlight]
        lamp.ambient = look.ambient
        for k, light in enumerate(lights[: len(look.direction)]):
            direction, emission = look.direction[k], look.emission[k]
            light.dir, light.diffuse, light.specular = direction, emission, [SHINE * float(emission.max())] * 3
            if self._looks.local[k]:
                light.pos = look.position[k]
        self._scene.flags[_SHADOW] = look.shadows
        if self._sky.wear(None if look.sky else look.background):
            mujoco.mjr_uploadTexture(self._model, self._context, self._sky.texture)

    def _shade(self, look: Look, places: Array, far: float) -> None:
        """Lay the shadow maps of lights from far away around the bodies, at (B, 3), and let no ground cast a shadow.

        The viewer lays them around the whole model, where a robot on a wide ground is nothing. It draws them a pixel
        smaller at each edge than it reads them, so that ground would be dotted with its own shadow off their middle.
        """
        middle = np.median(places, axis=0) if len(places) else np.zeros(3)
        reach = float(np.abs(places - middle).max(initial=0.0))
        self._context.shadowClip = min(self._widest, 2 * reach + AROUND)
        for k, light in enumerate(list(self._scene.lights)[1 : self._scene.nlight]):
            if k < len(look.direction) and not self._looks.local[k]:
                light.pos = shadow_place(middle, look.direction[k], min(AROUND, far / 2))
        for geom in self._scene.geoms[: self._scene.ngeom]:
            if geom.type in _GROUND:
                geom.category = _UNSHADING

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


class Frames:
    """Geoms and lights where given body poses put them. Nothing follows from joints, so any moment can be drawn."""

    def __init__(self, model: Any, layout: Layout) -> None:
        self._data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, self._data)  # the frame of the world, which no pose is of
        self._bodies = layout.bodies
        self._drawn = np.flatnonzero(np.isin(model.geom_group, DRAWN_GROUPS)).tolist()

    def placed(self, model: Any, poses: Array) -> Any:
        """The data of an env whose bodies have these poses (B, 7), as far as it is drawn; good until the next call.

        The sums are those of `mj_kinematics`, so recorded poses give the pixels that the state gave.
        """
        data, bodies = self._data, self._bodies
        data.xpos[bodies], data.xquat[bodies] = poses[:, :3], wxyz_from_xyzw(poses[:, 3:])
        xmat, xquat = data.xmat, data.xquat
        for body in bodies.tolist():
            mujoco.mju_quat2Mat(xmat[body], xquat[body])
        xpos, turn, owner, aligned = data.geom_xpos, data.geom_xmat, model.geom_bodyid, model.geom_sameframe
        place, quat = model.geom_pos, model.geom_quat
        for geom in self._drawn:
            mujoco.mj_local2Global(
                data, xpos[geom], turn[geom], place[geom], quat[geom], int(owner[geom]), aligned[geom]
            )
        mujoco.mj_camlight(model, data)
        return data


class Sky:
    """The texture behind everything: MuJoCo's gradient, or one colour."""

    def __init__(self, model: Any) -> None:
        self.texture = next(t for t in range(model.ntex) if model.tex_type[t] == mujoco.mjtTexture.mjTEXTURE_SKYBOX)
        first = int(model.tex_adr[self.texture])
        size = int(model.tex_height[self.texture] * model.tex_width[self.texture] * model.tex_nchannel[self.texture])
        self._pixels = model.tex_data[first : first + size].reshape(-1, model.tex_nchannel[self.texture])
        self._gradient, self._worn = self._pixels.copy(), b""

    def wear(self, color: Array | None) -> bool:
        """Take a colour (3,), or None for the gradient; whether that is another than before."""
        levels = None if color is None else np.rint(np.clip(color, 0.0, 1.0) * 255).astype(np.uint8)
        wanted = b"" if levels is None else levels.tobytes()
        if wanted == self._worn:
            return False
        self._worn = wanted
        self._pixels[:] = self._gradient if levels is None else levels
        return True


def _make_context(model: Any) -> Any:
    context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50.value)
    mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, context)
    context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
    return context


def _metres(raw: Array, near: float, far: float) -> Array:
    """Distance along the optical axis from a reversed depth buffer: 1 at the near plane, 0 from the far one on."""
    inverse = 1 / far + raw.astype(np.float64) * (1 / near - 1 / far)
    return np.where(raw > 0, 1 / inverse, np.inf).astype(np.float32)
