"""Textures and materials of a World in an MjSpec: one MuJoCo material for each pair that a geom may have.

A texture is a cube map on what has faces, so that each side shows it once; planes and height fields take it flat, once
a metre.
"""

from typing import Any

import mujoco
import numpy as np

from anysim.conventions import Array
from anysim.model.appearance import NONE
from anysim.model.world import Geom, HeightFieldShape, Plane, World

NEUTRAL_RGBA = (0.5, 0.5, 0.5, 1.0)
"""A geom of exactly this colour takes its material's, which is therefore the same."""

PLAIN, GROUND = "plain", "ground"


def lies_flat(geom: Geom) -> bool:
    """Whether textures are not wrapped around it."""
    return isinstance(geom.shape, Plane | HeightFieldShape)


def look_name(geom: Geom, texture: int, material: int) -> str:
    """The MuJoCo material of a geom with this texture and material of the World; -1 for none."""
    flat = lies_flat(geom)
    if texture == NONE and material == NONE:
        return GROUND if flat else PLAIN
    return f"look {texture} {material}{' flat' if flat and texture != NONE else ''}"


def add_looks(spec: Any, world: World) -> None:
    """Add the textures, and materials for all pairs."""
    for i, texture in enumerate(world.textures):
        face = np.ascontiguousarray(texture.tiled())
        side = len(face)
        wrapped = spec.add_texture(
            name=f"texture {i}", type=mujoco.mjtTexture.mjTEXTURE_CUBE, width=side, height=6 * side, nchannel=3
        )
        wrapped.data = np.tile(face, (6, 1, 1)).tobytes()
        flat = spec.add_texture(
            name=f"texture {i} flat", type=mujoco.mjtTexture.mjTEXTURE_2D, width=side, height=side, nchannel=3
        )
        flat.data = face.tobytes()
    for m in range(NONE, len(world.materials)):
        for t in range(NONE, len(world.textures)):
            if (t, m) != (NONE, NONE):
                _add(spec, world, t, m, "")
            if t != NONE:
                _add(spec, world, t, m, " flat")


def _add(spec: Any, world: World, texture: int, material: int, kind: str) -> None:
    element = spec.add_material(name=f"look {texture} {material}{kind}", rgba=NEUTRAL_RGBA)
    if material == NONE:
        element.specular, element.shininess = 0.25, 0.4
    else:
        look = world.materials[material]
        # a lamp's highlight: as strong as the material reflects, as small as it is smooth
        element.specular = max(look.specular, look.metallic)
        element.shininess, element.emission = 1.0 - look.roughness, look.emission
        element.metallic, element.roughness = look.metallic, look.roughness
    if texture != NONE:
        textures = element.textures
        textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = f"texture {texture}{kind}"
        element.textures = textures
        if kind:
            element.texuniform, element.texrepeat = True, (1.0, 1.0)


class Skins:
    """Where the materials are in a compiled model, and back."""

    def __init__(self, world: World, model: Any) -> None:
        rows, columns = len(world.textures) + 1, len(world.materials) + 1
        self._table = np.empty((len(world.geoms), rows, columns), dtype=int)
        for g, geom in enumerate(world.geoms):
            for t in range(rows):
                for m in range(columns):
                    name = look_name(geom, t - 1, m - 1)
                    self._table[g, t, m] = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_MATERIAL, name)

    def ids(self, geoms: Array, texture: Array, material: Array) -> Array:
        """MuJoCo's materials (E, K) of World geoms (K,) with these indices (E, K)."""
        return self._table[geoms, texture.astype(int) + 1, material.astype(int) + 1]

    def pairs(self, ids: Array) -> tuple[Array, Array]:
        """The textures and materials (..., G) of World geoms whose MuJoCo materials are `ids` (..., G)."""
        match = self._table == ids[..., None, None]
        texture, material = match.any(axis=-1).argmax(axis=-1), match.any(axis=-2).argmax(axis=-1)
        return texture.astype(float) - 1, material.astype(float) - 1
