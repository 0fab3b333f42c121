"""Layer `task`: the same episodes, solved by the task's own expert."""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import combinations
from pathlib import Path
from statistics import median

from anysim.api import make
from anysim.math.statistics import wilson
from anysim.skills.runner import SkillPolicy
from anysim_parity.engines import guarded
from anysim_parity.result import Gap, Layer, Measure, Plot, Series
from anysim_recording.collector import Collector, EpisodeResult
from anysim_schemas.load import LoadedRun

MAX_ENVS = 8

_QUESTION = "Does the task's expert solve the same episodes on every engine?"

Tick = Callable[[str], None]
"""Called with the engine's name after each episode."""

Results = dict[tuple[int, int], EpisodeResult]


def task_layer(
    loaded: LoadedRun, engines: Sequence[str], *, episodes: int, seed: int = 0, tick: Tick = lambda engine: None
) -> Layer:
    """Run the expert in the same episodes on every engine. Nothing is kept of the recordings."""
    probes = {name: partial(_episodes, loaded, name, episodes, seed, tick) for name in engines}
    runs = guarded(probes)
    found = runs.found
    won = {name: sum(r.success for r in results.values()) for name, results in found.items()}
    measures = [
        Measure(
            "success", "", {name: won[name] / len(results) for name, results in found.items()}, tolerance=0.0,
            explanation=_why(found), intervals={name: wilson(won[name], len(r)) for name, r in found.items()},
        ),
        Measure("steps to success, median", "control steps", _medians(found)),
    ]  # fmt: skip
    gaps = [
        Gap("episodes that only one of the two solves", "", a, b, _only_one(found[a], found[b]))
        for a, b in combinations(found, 2)
    ]
    return Layer("task", _QUESTION, tuple(measures), _plots(found), refused=runs.refused, gaps=tuple(gaps))


def _episodes(loaded: LoadedRun, engine: str, episodes: int, seed: int, tick: Tick) -> Results:
    overrides = ["record.cameras=[]"]
    with (
        tempfile.TemporaryDirectory() as folder,
        make(loaded, engine=engine, num_envs=min(episodes, MAX_ENVS), overrides=overrides) as env,
    ):
        results: Results = {}
        for result in Collector(env, SkillPolicy(env), Path(folder), episodes, seed).run():
            results[result.env, result.episode] = result
            tick(engine)
        return dict(sorted(results.items()))


def _medians(found: Mapping[str, Results]) -> dict[str, float]:
    steps = {name: [r.steps for r in results.values() if r.success] for name, results in found.items()}
    return {name: float(median(values)) for name, values in steps.items() if values}


def _only_one(a: Results, b: Results) -> float:
    shared = sorted(set(a) & set(b))
    return sum(a[key].success != b[key].success for key in shared) / max(1, len(shared))


def _why(found: Mapping[str, Results]) -> str:
    """How the failures ended, by engine."""
    parts = []
    for name, results in found.items():
        ends: dict[str, int] = {}
        for result in results.values():
            if not result.success:
                end = str(result.outcome.get("outcome") or result.status)
                ends[end] = ends.get(end, 0) + 1
        if ends:
            parts.append(f"{name} fails by {', '.join(f'{end} ({n})' for end, n in sorted(ends.items()))}")
    return "; ".join(parts)


def _plots(found: Mapping[str, Results]) -> tuple[Plot, ...]:
    """Steps of each solved episode, over the episodes in the order of envs."""
    series = []
    for name, results in found.items():
        rows = [(float(i + 1), float(r.steps)) for i, r in enumerate(results.values()) if r.success]
        if rows:
            series.append(Series(name, tuple(x for x, _ in rows), tuple(y for _, y in rows)))
    return (Plot("Steps to success by episode", "episode", "control steps", tuple(series)),) if series else ()
