"""A comparison as a whole, and as plain data."""

from math import isfinite
from typing import Any, NamedTuple

from anysim_parity.judge import nearest
from anysim_parity.result import Layer, Measure, Plot, Series
from anysim_parity.verdict import disagreements, findings

FORMAT = "anysim-compare-1"


class Comparison(NamedTuple):
    """What was compared, how, and what came out.

    Attributes:
        name: of the task or world.
        engines: by name the version; only those that were asked for.
        seed: of the tape, the joint positions and the episodes.
        episodes: of the layer `task`, per engine; 0 where it was not run.
        world_hash: of the neutral world.
        world: in words, such as `10 bodies, 9 joints`.
        layers: in the order in which one rests on the other.
    """

    name: str
    engines: dict[str, str]
    seed: int
    episodes: int
    world_hash: str
    world: str
    layers: tuple[Layer, ...]


def as_data(comparison: Comparison) -> dict[str, Any]:
    """Plain data for JSON; numbers that are not finite become null, pictures are left to the page."""
    differing = disagreements(comparison.layers)
    return {
        "format": FORMAT,
        "name": comparison.name,
        "engines": comparison.engines,
        "seed": comparison.seed,
        "episodes": comparison.episodes,
        "world_hash": comparison.world_hash,
        "world": comparison.world,
        "differ": len(differing),
        "layers": [_layer(layer) for layer in comparison.layers],
    }


def _layer(layer: Layer) -> dict[str, Any]:
    found = findings(layer)
    return {
        "name": layer.name,
        "question": layer.question,
        "compared": len(found),
        "measures": [_measure(measure) for measure in layer.measures],
        "gaps": [{key: _plain(value) for key, value in gap._asdict().items()} for gap in layer.gaps],
        "differ": [{key: _plain(value) for key, value in f._asdict().items()} for f in found if not f.agree],
        "refused": dict(layer.refused),
        "plots": [_plot(plot) for plot in layer.plots],
    }


def _measure(measure: Measure) -> dict[str, Any]:
    data = {key: _plain(value) for key, value in measure._asdict().items()}
    data["nearest"] = list(nearest(measure))
    return data


def _plot(plot: Plot) -> dict[str, Any]:
    return {
        "title": plot.title,
        "x_label": plot.x_label,
        "y_label": plot.y_label,
        "series": [_series(series) for series in plot.series],
        "reference": None if plot.reference is None else _series(plot.reference),
    }


def _series(series: Series) -> dict[str, Any]:
    return {"name": series.name, "x": _plain(series.x), "y": _plain(series.y)}


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, dict):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(part) for part in value]
    return value
