"""Textures and materials of a spec: their names, which follow from the spec alone, and what they stand for."""

import hashlib
import io
import json
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from anysim.assets.texture_patterns import draw_pattern
from anysim.assets.uri import locate
from anysim.conventions import Array
from anysim.errors import AssetError
from anysim.model.appearance import Material, Texture
from anysim.model.colors import Rgb, rgb
from anysim_schemas.matter import MaterialSpec, TextureSpec
from anysim_schemas.values import Choice

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
        ValueError: an unknown colour name.
    """
    if spec.image is not None:
        pixels = _read(spec.image, base)
        content = f"{pixels.shape}".encode() + pixels.tobytes()
    else:
        assert spec.pattern is not None
        low, high = (None, None) if spec.colors is None else (rgb(spec.colors[0]), rgb(spec.colors[1]))
        pixels = draw_pattern(spec.pattern, low, high, spec.seed, spec.resolution)
        # what it is made from: a sine may differ in its last bit between two machines
        content = f"{PATTERN_FORMAT} {json.dumps(spec.to_dict(), sort_keys=True)}".encode()
    pixels.setflags(write=False)
    return Texture(texture_name(spec), pixels, spec.repeat, hashlib.sha256(content).hexdigest())


def _read(uri: str, base: Path | None) -> Array:
    """The pixels (S, S, 3) uint8 of an image file, stretched to a square; one with transparency is laid on white."""
    from PIL import Image, UnidentifiedImageError

    path = locate(uri, base=base).path
    try:
        with Image.open(io.BytesIO(path.read_bytes())) as image:
            side = min(max(image.size), MAX_IMAGE_SIDE)
            shown = Image.new("RGBA", (side, side), (255, 255, 255, 255))
            shown.alpha_composite(image.convert("RGBA").resize((side, side)))
    except (UnidentifiedImageError, OSError, Image.DecompressionBombError) as error:
        raise AssetError(f"image '{uri}' cannot be read: {error}") from error
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
