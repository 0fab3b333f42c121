"""`anysim describe`: a scene, a task and a recorded episode in words."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from anysim.cli.options import AsJson, Overrides, Seed

if TYPE_CHECKING:
    from anysim_language.describe import Description


def describe(
    source: Annotated[
        str, typer.Argument(metavar="TASK|RUN", help="An installed task, a YAML file, a recorded run or a trajectory.")
    ],
    seed: Seed = None,
    phrasing: Annotated[int, typer.Option("--phrasing", "-p", min=0, help="Chooses among ways to say the same.")] = 0,
    override: Overrides = None,
    base: Annotated[
        Path | None, typer.Option(help="Folder of the recorded file, where its world has assets with relative paths.")
    ] = None,
    json: AsJson = False,
) -> None:
    """Say in words what there is, what is to be done, and, of a recorded episode, what happened.

    All of it follows from facts: the world, what was drawn, recorded states and the phases of skills. The same words
    come out on every machine. A task is described as its first episode under --seed begins; the engine does not matter.

    Examples:
      anysim describe pick_cube --seed 1
      anysim describe runs/pick --phrasing 3
      anysim describe runs/pick/episodes/env_0000_episode_0000 --json
    """
    from anysim.cli.output import print_json
    from anysim.record.names import MANIFEST_FILE, RUN_FILE, find_trajectories
    from anysim_language.describe import described_task, described_trajectory
    from anysim_schemas.files import exists

    path = Path(source)
    if exists(path / MANIFEST_FILE) or exists(path / RUN_FILE):
        found = [described_trajectory(one, phrasing, base) for one in find_trajectories([path])]
    else:
        found = [described_task(path if exists(path) else source, seed, phrasing, override or [])]
    if json:
        print_json([one.as_data() for one in found])
        return
    for one in found:
        _tell(one, headed=len(found) > 1)


def _tell(one: "Description", headed: bool) -> None:
    if headed:
        typer.echo(f"{one.source}:")
    typer.echo(one.scene)
    typer.echo(one.instruction)
    for sentence in one.narration:
        typer.echo(f"{sentence.step:6d}  {sentence.text}")
