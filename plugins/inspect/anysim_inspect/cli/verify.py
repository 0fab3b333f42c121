"""`anysim verify`: whether recordings are what was committed."""

from pathlib import Path
from typing import Annotated

import typer

from anysim.cli.options import AsJson


def verify(
    directories: Annotated[list[Path], typer.Argument(metavar="DIR…", help="Trajectories, or runs with many of them.")],
    json: AsJson = False,
) -> None:
    """Read every byte of trajectories and name what is not as it was committed; nothing is simulated.

    Exit code 1 if one is damaged.

    Examples:
      anysim verify runs/a
    """
    from anysim.cli.output import print_json
    from anysim.record.names import find_trajectories
    from anysim_inspect.verify import verify as faults_of

    found = {str(path): faults_of(path) for path in find_trajectories(directories)}
    damaged = {path: faults for path, faults in found.items() if faults}
    if json:
        print_json({"verified": len(found), "damaged": damaged})
    else:
        for path, faults in damaged.items():
            typer.echo(f"error: {path} is damaged: {'; '.join(faults)}", err=True)
        typer.echo(f"{len(found) - len(damaged)} of {len(found)} trajectories are whole")
    if damaged:
        raise typer.Exit(1)
