"""`anysim replay`: rebuild recorded runs and compare every state."""

from pathlib import Path
from typing import Annotated

import typer

from anysim.cli.options import AsJson, Engine


def replay(
    directories: Annotated[list[Path], typer.Argument(metavar="DIR…", help="Trajectories, or runs with many of them.")],
    engine: Engine = None,
    base: Annotated[
        Path | None, typer.Option(help="Folder of the recorded file, where its world has assets with relative paths.")
    ] = None,
    json: AsJson = False,
) -> None:
    """Replay trajectories from their manifests alone, and compare every recorded state.

    On the engine that recorded them they must be equal to the bit (exit code 1 if not); on another engine the drift is
    reported.
    """
    from anysim.cli.output import print_json, print_table
    from anysim.errors import RecordError
    from anysim.record.layout import MANIFEST_FILE, trajectories
    from anysim.record.replay import replay as replay_one
    from anysim.record.verify import verify

    found: list[Path] = []
    for directory in directories:
        inside = [directory] if (directory / MANIFEST_FILE).exists() else trajectories(directory)
        if not inside:
            raise RecordError(f"{directory} holds no trajectory; expected a directory with a {MANIFEST_FILE}, or a run")
        found.extend(inside)
    rows: list[dict[str, object]] = []
    for path in found:
        faults = verify(path)
        if faults:
            raise RecordError(f"{path} is damaged: {'; '.join(faults)}")
        result = replay_one(path, engine, base)
        row = {
            "trajectory": str(path), "engine": result.engine, "identical": result.identical,
            "steps": result.drift.recorded_steps, "first difference": result.drift.first_step,
            "largest difference": max((f.max_abs for f in result.drift.fields.values()), default=0.0),
            "recorded": result.recorded_status, "replayed": result.status, "same world": result.same_world,
            "same start": result.same_start,
        }  # fmt: skip
        rows.append(row)
        if not json:
            notes = "" if result.same_world else " (the rebuilt world is another one)"
            notes += "" if result.same_start else " (it starts from another state)"
            typer.echo(f"{path.name}: {result.drift}{notes}")
    same = sum(bool(row["identical"]) for row in rows)
    if json:
        print_json({"replayed": len(rows), "identical": same, "trajectories": rows})
    else:
        if same < len(rows):
            print_table("Replays", list(rows[0]), [list(row.values()) for row in rows])
        typer.echo(f"{same} of {len(rows)} replays are identical to the bit")
    if engine is None and same < len(rows):
        raise typer.Exit(1)
