"""Pictures of a world: its first episodes, drawn by each engine, side by side."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from anysim.api import load, make, watched
from anysim.conventions import Array
from anysim.engine.capability import Capability
from anysim.engine.factory import engine_class
from anysim.errors import AnysimError, NameLookupError, listing, suggest
from anysim_schemas.load import LoadedRun, LoadedSpec


class Pictures(NamedTuple):
    """By engine its images (N, H, W, 3) uint8, one for each env, or why there are none."""

    images: dict[str, Array]
    refused: dict[str, str]


def pictures(
    source: str | Path | LoadedRun | Mapping[str, Any],
    engines: Sequence[str],
    *,
    num_envs: int = 4,
    seed: int = 0,
    camera: str | None = None,
    size: tuple[int, int] | None = None,
    seconds: float = 0.0,
    overrides: Sequence[str] = (),
    tell: Callable[[str], object] = lambda words: None,
) -> Pictures:
    """Start the episodes of a seed on each engine, let them run for a while without action, and draw them.

    Things cast shadows where the engine has them and the file says nothing of them.

    Args:
        source: a task or a world: an installed task by name, a YAML file, or what `load` returned.
        engines: installed engines by name.
        num_envs: how many envs, each with its own episode.
        seed: what the episodes are drawn from.
        camera: one of the world's; its first where not given, or an overview where it has none.
        size: width and height [px]; the camera's own where not given.
        seconds: simulated time before the image is taken.
        overrides: dotted overrides, as `-o` on the command line.
        tell: called with a few words whenever something begins that may take long.

    Raises:
        SpecError: the file, with line and column.
        NameLookupError: the world has no such camera.
    """
    loaded = source if isinstance(source, LoadedSpec) else load(source, overrides=overrides)
    cameras = list(loaded.spec.world.cameras)
    if camera is not None and camera not in [*cameras, "default"]:
        raise NameLookupError(
            f"the world has no camera '{camera}'{suggest(camera, cameras)} (cameras: {listing(cameras)}, and `default`)"
        )
    loaded = watched(loaded)
    chosen = camera or (cameras[0] if cameras else "default")
    found = Pictures({}, {})
    for name in engines:
        try:
            found.images[name] = _drawn(
                _shaded(loaded, name), name, num_envs, seed, chosen, size or (None, None), seconds, tell
            )
        except AnysimError as error:
            found.refused[name] = str(error)
    return found


def _shaded(loaded: LoadedRun, engine: str) -> LoadedRun:
    """The same with shadows, if the engine has them and the spec leaves them open."""
    said = loaded.spec.world.scenery.shadows is not None
    if said or Capability.RENDER_SHADOWS not in engine_class(engine).capabilities:
        return loaded
    shaded = load(loaded.data, overrides=["world.scenery.shadows=true"])
    return replace(shaded, files=loaded.files, provenance=loaded.provenance)


def _drawn(
    loaded: LoadedRun,
    engine: str,
    num_envs: int,
    seed: int,
    camera: str,
    size: tuple[int | None, int | None],
    seconds: float,
    tell: Callable[[str], object],
) -> Array:
    tell(f"{engine}: building {num_envs} envs")
    with make(loaded, engine=engine, num_envs=num_envs) as env:
        for number in range(num_envs):  # draws belong to their env: one after the other gives the same as all at once
            tell(f"{engine}: starting env {number + 1} of {num_envs}")
            env.reset(seed=seed, mask=np.arange(num_envs) == number)
        if seconds > 0:
            tell(f"{engine}: {seconds:g} s pass")
            env.engine.step(max(1, round(seconds / env.engine.world.physics.dt)))
        images: list[Array] = []
        for number in range(num_envs):
            tell(f"{engine}: drawing env {number + 1} of {num_envs}")
            images.append(env.render(camera, [number], size=size))
        return np.concatenate(images)


def sheet(found: Pictures, columns: int | None = None) -> Any:
    """A matplotlib Figure: for each engine its name and a montage of its images.

    Raises:
        AnysimError: no engine has drawn anything; says why of each.
    """
    if not found.images:
        raise AnysimError("; ".join(f"{name}: {why}" for name, why in found.refused.items()) or "no engine was named")
    from matplotlib.figure import Figure

    sheets = {name: montage(images, columns) for name, images in found.images.items()}
    height, width = next(iter(sheets.values())).shape[:2]
    figure = Figure(figsize=(4.0 * len(sheets), 4.0 * height / width + 0.3), layout="constrained")
    for axis, (name, image) in zip(figure.subplots(1, len(sheets), squeeze=False)[0], sheets.items(), strict=True):
        axis.imshow(image)
        axis.set_title(name, fontsize=9, loc="left")
        axis.set_axis_off()
    return figure


def montage(images: Array, columns: int | None = None, gap: int = 4) -> Array:
    """One image (H', W', 3) uint8 of many (N, H, W, 3), row by row, about as wide as high, white between them."""
    count, height, width, _ = images.shape
    across = columns or int(np.ceil(np.sqrt(count)))
    down = -(-count // across)
    sheet = np.full((down * (height + gap) - gap, across * (width + gap) - gap, 3), 255, dtype=np.uint8)
    for number, image in enumerate(images):
        top, left = (number // across) * (height + gap), (number % across) * (width + gap)
        sheet[top : top + height, left : left + width] = image
    return sheet
