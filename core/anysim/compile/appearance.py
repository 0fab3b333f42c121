"""Textures, materials, lights and surroundings of a spec, with the nominal value of what is drawn in each episode.

The names of textures and materials follow from the spec alone.
"""

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from anysim import registry
from anysim.assets.bounded_files import opened_image
from anysim.assets.uri import locate
from anysim.conventions import Array
from anysim.errors import Issues
from anysim.model.appearance import WHITE, Material, Rgb, Texture, nominal_rgb, rgb
from anysim.model.world import Light, Scenery
from anysim.randomization.distributions import nominal
from anysim_schemas.lights import LightSpec, ScenerySpec
from anysim_schemas.matter import MaterialSpec, TextureSpec
from anysim_schemas.values import Choice, Distribution

MAX_IMAGE_SIDE = 1024
"""Larger images are made smaller: an engine holds a texture six times, once for each side."""

PATTERN_FORMAT = "anysim-patterns-1"
"""Part of the hash of a pattern; another one whenever the same spec gives other pixels."""

PRESETS: Mapping[str, Material] = {
    "matte": Material("matte"),
    "plastic": Material("plastic", (0.75, 0.75, 0.78), roughness=0.35, specular=0.6),
    "rubber": Material("rubber", (0.12, 0.12, 0.13), roughness=0.95, specular=0.1),
    "metal": Material("metal", (0.72, 0.73, 0.75), roughness=0.25, metallic=1.0, specular=0.9),
    "glass": Material("glass", (0.80, 0.90, 0.92), roughness=0.05, specular=0.9, opacity=0.35),
    "wood": Material("wood", (0.62, 0.42, 0.24), roughness=0.7, specular=0.2),
    "ceramic": Material("ceramic", (0.93, 0.92, 0.89), roughness=0.15, specular=0.7),
    "lamp": Material("lamp", (1.00, 0.95, 0.80), roughness=0.9, specular=0.0, emission=1.0),
}


class Pattern(NamedTuple):
    """A procedural texture: a member of the kind `textures`.

    Attributes:
        weights: shares of the second colour at places (u to the right, v downwards, both in [0, 1)), from a seed.
        first: its own colour of weight 0; `second` that of weight 1.
    """

    weights: Callable[[Array, Array, int], Array]
    first: Rgb
    second: Rgb

    def pixels(self, first: Rgb | None, second: Rgb | None, seed: int, resolution: int) -> Array:
        """The image (resolution, resolution, 3) uint8; None for its own colour."""
        middle = (np.arange(resolution) + 0.5) / resolution
        u, v = np.meshgrid(middle, middle)
        weight = self.weights(u, v, seed)[..., None]
        low, high = np.array(first or self.first), np.array(second or self.second)
        # the cosine of two machines may differ in its last bit; half a grey level apart is far more than that
        return np.floor(255 * ((1 - weight) * low + weight * high) + 0.5 + 1e-9).astype(np.uint8)


def options(value: Any) -> Iterator[tuple[str, Any]]:
    """Every texture or material that a value can be, once, with its dotted path below the value's."""
    if value is None:
        return
    if not isinstance(value, Choice):
        yield "", value
        return
    yield from ((f"choice.{number}", one) for number, one in enumerate(value.choice))
    if value.otherwise is not None:
        yield "otherwise", value.otherwise


def by_name(value: Any, name: Any) -> Any:
    """A value of textures or materials as one of their names (`texture_name`, `material_name`), which can be drawn."""
    if not isinstance(value, Choice):
        return name(value)
    otherwise = None if value.otherwise is None else name(value.otherwise)
    return value.model_copy(update={"choice": tuple(map(name, value.choice)), "otherwise": otherwise})


def texture_name(spec: TextureSpec) -> str:
    """`checker`, `checker-1a2b3c4d` where anything else is given, `floor.png` for an image."""
    if spec.image is not None:
        return spec.image if spec.repeat == 1 else f"{spec.image} x{spec.repeat}"
    assert spec.pattern is not None  # the spec has exactly one of them
    return _name(spec.pattern, spec, TextureSpec(pattern=spec.pattern))


def material_name(spec: MaterialSpec) -> str:
    """`metal`, `metal-1a2b3c4d` where anything else is given."""
    return _name(spec.preset or "matte", spec, MaterialSpec(preset=spec.preset))


def _name(short: str, spec: Any, plain: Any) -> str:
    if spec == plain:
        return short
    text = json.dumps(spec.to_dict(), sort_keys=True)
    return f"{short}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"


def texture(spec: TextureSpec, base: Path | None) -> Texture:
    """The texture of a spec; relative paths are relative to `base`.

    Raises:
        AssetError: an image that is missing, leaves its root, or cannot be read.
        PluginError: the pattern is not installed.
        ValueError: an unknown colour name.
    """
    if spec.image is not None:
        pixels = _read(spec.image, base)
        content = f"{pixels.shape}".encode() + pixels.tobytes()
    else:
        assert spec.pattern is not None
        pattern: Pattern = registry.load("textures", spec.pattern)
        first, second = (None, None) if spec.colors is None else map(rgb, spec.colors)
        with registry.using("textures", spec.pattern):
            pixels = pattern.pixels(first, second, spec.seed, spec.resolution)
        # what it is made from: a sine may differ in its last bit between two machines
        content = f"{PATTERN_FORMAT} {json.dumps(spec.to_dict(), sort_keys=True)}".encode()
    pixels.setflags(write=False)
    return Texture(texture_name(spec), pixels, spec.repeat, hashlib.sha256(content).hexdigest())


def _read(uri: str, base: Path | None) -> Array:
    """The pixels (S, S, 3) uint8 of an image file, stretched to a square; one with transparency is laid on white."""
    from PIL import Image

    with opened_image(locate(uri, base=base).path) as image:
        side = min(max(image.size), MAX_IMAGE_SIDE)
        shown = Image.new("RGBA", (side, side), (255, 255, 255, 255))
        shown.alpha_composite(image.convert("RGBA").resize((side, side)))
    return np.array(shown.convert("RGB"), dtype=np.uint8)


def material(spec: MaterialSpec) -> Material:
    """The material of a spec: its preset, with what else the spec gives on top."""
    given = {name: value for name, value in spec.to_dict().items() if name != "preset"}
    return replace(PRESETS[spec.preset or "matte"], name=material_name(spec), **given)


def tint(color: Rgb | None, painted: bool, chosen: Material | None) -> Rgb | None:
    """The colour of a thing: its own, white under a texture, that of its material; None where nothing says it."""
    if color is not None:
        return color
    if painted:
        return (1.0, 1.0, 1.0)
    return None if chosen is None else chosen.color


DEFAULT_LIGHTS = (
    Light("key", direction=(-0.4, 0.3, -0.87), intensity=0.7),  # from the front right, as a lamp beside the viewer
    Light("fill", direction=(0.5, -0.6, -0.62), intensity=0.35),  # weaker, from the other side: no side is black
)
"""The lights of a world that asks for none; an engine may draw such a world with lights of its own."""


def compile_lights(specs: Mapping[str, LightSpec], issues: Issues) -> tuple[Light, ...]:
    """The lights, or a key and a fill light where none is given."""
    lights: list[Light] = []
    for name, spec in specs.items():
        direction = nominal(spec.direction)
        length = float(np.linalg.norm(direction))
        if length < 1e-9:
            text = "; choose bounds whose middle is not zero" if isinstance(spec.direction, Distribution) else ""
            issues.add(f"{name}.direction", f"a light needs a direction that is not zero{text}")
            continue
        x, y, z = (component / length for component in direction)
        position = None if spec.position is None else nominal(spec.position)
        color = nominal_rgb(spec.color, WHITE, issues, f"{name}.color")
        lights.append(Light(name, (x, y, z), position, color, nominal(spec.intensity)))
    return tuple(lights) if specs else DEFAULT_LIGHTS


def compile_scenery(spec: ScenerySpec, issues: Issues) -> Scenery:
    """Background, ambient light and shadows; None where the engine decides."""
    background = None if spec.background is None else nominal_rgb(spec.background, WHITE, issues, "background")
    ambient = None if spec.ambient is None else nominal_rgb(spec.ambient, WHITE, issues, "ambient")
    return Scenery(background, ambient, None if spec.shadows is None else bool(nominal(spec.shadows)))
