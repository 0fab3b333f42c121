"""`anysim replay`: rebuild recorded runs and compare every state."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from anysim.cli.options import AsJson

if TYPE_CHECKING:
    from anysim.record.replay import ReplayResult
    from anysim_inspect.replay_summary import FieldSummary


def replay(
    directories: Annotated[list[Path], typer.Argument(metavar="DIR…", help="Trajectories, or runs with many of them.")],
    engine: Annotated[
        str | None, typer.Option("--engine", "-e", help="Another installed engine than that of the recording.")
    ] = None,
    base: Annotated[
        Path | None, typer.Option(help="Folder of the recorded file, where its world has assets with relative paths.")
    ] = None,
    json: AsJson = False,
) -> None:
    """Replay trajectories from their manifests alone, and compare every recorded state.

    On the engine that recorded them they must be equal to the bit; exit code 1 if not, or if one is damaged. On another
    engine the same actions lead elsewhere: the drift of every state array is reported, and whether the episodes end
    alike.

    Examples:
      anysim replay runs/a
      anysim replay runs/a/episodes/env_0000_episode_0000 --engine pybullet
    """
    from anysim.cli.output import counting, print_json
    from anysim.record.names import find_trajectories
    from anysim.record.replay import replay as replay_one
    from anysim_inspect.verify import verify

    found = find_trajectories(directories)
    results: dict[str, ReplayResult] = {}
    damaged: dict[str, list[str]] = {}
    with counting("replays", len(found), quiet=json) as show:
        for path in found:
            faults = verify(path)
            if faults:
                damaged[str(path)] = faults
                typer.echo(f"error: {path} is damaged: {'; '.join(faults)}", err=True)
                continue
            result = results[str(path)] = replay_one(path, engine, base)
            notes = "" if result.same_world else " (the rebuilt world is another one)"
            notes += "" if result.same_start else " (it starts from another state)"
            show(f"{path.name}: {result.drift}{notes}")
    same = sum(result.identical for result in results.values())
    if json:
        print_json(
            {
                "replayed": len(results),
                "damaged": damaged,
                "identical": same,
                "same_outcome": sum(map(_same_outcome, results.values())),
                "drift": [row._asdict() for row in _summary(results)],
                "trajectories": [_row(path, result) for path, result in results.items()],
            }
        )
    elif results:
        _report(results, same)
    if damaged or (engine is None and same < len(results)):
        raise typer.Exit(1)


def _same_outcome(result: "ReplayResult") -> bool:
    return result.status == result.recorded_status


def _summary(results: "dict[str, ReplayResult]") -> "list[FieldSummary]":
    from anysim_inspect.replay_summary import summarise

    return summarise({Path(path).name: result.drift for path, result in results.items()})


def _row(path: str, result: "ReplayResult") -> dict[str, object]:
    return {
        "trajectory": path,
        "engine": result.engine,
        "identical": result.identical,
        "steps": result.drift.recorded_steps,
        "first_difference": result.drift.first_step,
        "largest_difference": {name: field.max_abs for name, field in result.drift.fields.items()},
        "recorded": result.recorded_status,
        "replayed": result.status,
        "same_world": result.same_world,
        "same_start": result.same_start,
        "explanation": result.explanation,
    }


def _report(results: "dict[str, ReplayResult]", same: int) -> None:
    """The drift where there is any, how the episodes ended where that differs, and one line that sums up."""
    from anysim.cli.output import print_table

    total, first = len(results), next(iter(results.values()))
    if same < total:
        print_table(
            f"Largest differences, recorded on {first.manifest.engine}, replayed on {first.engine}",
            ("state", "identical", "from step", "median", "worst", "in"),
            [
                (
                    row.name,
                    f"{row.identical} of {total}",
                    row.first_step,
                    f"{row.median:.3g}",
                    f"{row.worst:.3g}",
                    row.worst_replay,
                )
                for row in _summary(results)
            ],
        )
        other = {path: result for path, result in results.items() if not _same_outcome(result)}
        if other:
            rows = [(Path(path).name, result.recorded_status, result.status) for path, result in other.items()]
            print_table("Episodes that end otherwise", ("trajectory", "recorded", "replayed"), rows)
        typer.echo(f"{total - len(other)} of {total} episodes end as recorded")
    typer.echo(f"{same} of {total} replays are identical to the bit")
    if same < total and first.manifest.engine == first.engine.partition(" ")[0] and first.explanation:
        typer.echo(first.explanation)
