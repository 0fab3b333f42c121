"""`anysim verify`: whether recordings are what was committed."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from anysim.cli.options import AsJson

if TYPE_CHECKING:
    from anysim_inspect.verify_runs import RunCheck


def verify(
    directories: Annotated[list[Path], typer.Argument(metavar="DIR…", help="Trajectories, or runs with many of them.")],
    replay: Annotated[
        bool,
        typer.Option("--replay", help="Also replay each on the engine that recorded it: equal to the bit, or not."),
    ] = False,
    base: Annotated[
        Path | None, typer.Option(help="Folder of the recorded file, where its world has assets with relative paths.")
    ] = None,
    json: AsJson = False,
) -> None:
    """Read every byte of trajectories and name what is not as it was committed; nothing is simulated.

    Compared are hashes, every stream and every frame of the videos, counts and times with the manifest, the manifest
    with run.json, and the recorded hash of the world with that of the world which the recorded spec gives. What
    interrupted runs have left half written is listed, with the remedy; it is no damage.

    Exit code 1 if one is damaged.

    Examples:
      anysim verify runs/a
      anysim verify runs/a --replay
    """
    from anysim.cli.output import counting, print_json
    from anysim.record.names import find_trajectories
    from anysim_inspect.verify_runs import as_data, verify_all

    found = find_trajectories(directories)
    damaged: dict[str, list[str]] = {}
    with counting("verified", len(found), quiet=json) as show:

        def done(path: Path, faults: list[str]) -> None:
            if faults:
                damaged[str(path)] = faults
            show(f"{path.name}: {'damaged' if faults else 'whole'}", f"{len(damaged)} damaged")

        checks = verify_all(found, base=base, again=(lambda path: _replayed(path, base)) if replay else None, done=done)
    if json:
        print_json({"verified": len(found), "damaged": damaged, "runs": [as_data(check) for check in checks]})
    else:
        _report(checks, damaged)
    if not all(check.whole for check in checks):
        raise typer.Exit(1)


def _replayed(path: Path, base: Path | None) -> list[str]:
    """Why a replay is not the recording, bit for bit; empty if it is."""
    from anysim.record.replay import replay

    result = replay(path, base=base)
    reasons = [
        *([] if result.same_world else ["the rebuilt world is another one"]),
        *([] if result.same_start else ["it starts from another state"]),
        *([] if result.drift.identical else [f"it differs from step {result.drift.first_step} on"]),
    ]
    said = f"{path} does not replay to the bit: {', '.join(reasons)}. {result.explanation}".rstrip()
    return [said] if reasons else []


def _report(checks: "list[RunCheck]", damaged: dict[str, list[str]]) -> None:
    from anysim.cli.output import print_table

    for path, faults in damaged.items():
        typer.echo(f"error: {path} is damaged: {'; '.join(faults)}", err=True)
    for check in checks:
        for fault in check.faults:
            typer.echo(f"error: {fault}", err=True)
        for left in check.left:
            typer.echo(f"left over: {left}", err=True)
        for note in check.notes:
            typer.echo(f"note: {note}", err=True)
    print_table(
        "Runs",
        ("run", "trajectories", "damaged", "steps", "left over"),
        [(c.run, len(c.trajectories), c.damaged, f"{c.steps:,}", len(c.left) or None) for c in checks],
    )
    total = sum(len(check.trajectories) for check in checks)
    typer.echo(f"{total - len(damaged)} of {total} trajectories are whole")
