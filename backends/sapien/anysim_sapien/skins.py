"""Textures and materials on SAPIEN's render materials."""

from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.model.appearance import NONE, Material
from anysim.model.world import World
from anysim_sapien.library import sapien

_KEPT = 256
"""Tinted textures that are kept: drawn colours give ever new ones."""

PLAIN = Material("", roughness=1.0, specular=0.0)
"""SAPIEN's own default, of what has no material."""


class Skins:
    """Gives looks to render materials, and keeps the textures. SAPIEN has no tint, so a texture is one for a colour."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._textures: dict[tuple[int, bytes], Any] = {}
        self._given: dict[int, tuple[Any, ...]] = {}

    def clear(self) -> None:
        """Free the device's copies."""
        self._textures.clear()
        self._given.clear()

    def give(self, target: Any, color: Array, texture: int, material: int) -> float:
        """Have a render material show this colour (4,), texture and material; -1 for none. Returns its opacity."""
        look = PLAIN if material == NONE else self._world.materials[material]
        wanted, before = (color.tobytes(), texture, material), self._given.get(id(target))
        if before == wanted:
            return look.opacity
        self._given[id(target)] = wanted
        target.set_base_color(color.tolist())
        if self._world.textures:
            # SAPIEN settles at the first image whether a material has a texture: what has none gets a plain one
            target.set_base_color_texture(self._tinted(texture, color))
        if material != NONE or (before is not None and before[2] != NONE):
            target.set_roughness(look.roughness)
            target.set_metallic(look.metallic)
            target.set_specular(look.specular)
            target.set_emission([*(look.emission * color[:3]).tolist(), 1.0])
        return look.opacity

    def _tinted(self, texture: int, color: Array) -> Any:
        key = (texture, color.tobytes())
        if key not in self._textures:
            if len(self._textures) >= _KEPT:
                self._textures.clear()
            white = np.full((1, 1, 3), 255.0)
            pixels = (white if texture == NONE else self._world.textures[texture].tiled()) * color[:3]
            whole = np.concatenate([pixels, np.full((*pixels.shape[:2], 1), 255.0 * color[3])], axis=-1)
            self._textures[key] = sapien.render.RenderTexture2D(
                np.ascontiguousarray(np.rint(whole).astype(np.uint8)), "R8G8B8A8Unorm", srgb=False
            )
        return self._textures[key]
