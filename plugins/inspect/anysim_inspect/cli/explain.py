"""`anysim explain`: what an episode drew, and why."""

from pathlib import Path
from typing import Annotated

import typer

from anysim.cli.options import AsJson, Overrides, Seed, Task


def explain(
    task: Task,
    seed: Seed = None,
    episode: Annotated[int, typer.Option("--episode", "-E", min=0, help="The env's episode, counted from 0.")] = 0,
    env: Annotated[int, typer.Option("--env", "-i", min=0, help="The env, counted from 0.")] = 0,
    override: Overrides = None,
    json: AsJson = False,
) -> None:
    """Say what was drawn in an episode: each value, the stream it comes from, and the line of YAML that asks for it.

    The same on every engine, and whatever the number of envs. `anysim run TASK --seed S` has this episode in env I.

    Examples:
      anysim explain pick_cube --seed 1
      anysim explain my_world.yaml --seed 1 --episode 2 --env 3
    """
    from anysim.cli.output import print_json, print_table
    from anysim_inspect.draws import explain as explain_one
    from anysim_schemas.files import exists

    found = explain_one(
        Path(task) if exists(task) else task, seed=seed, env=env, episode=episode, overrides=override or []
    )
    if json:
        print_json({"episode_seed": found.episode_seed, "draws": [draw._asdict() for draw in found.draws]})
        return
    print_table(
        f"Env {env}, episode {episode} of seed {found.seed}",
        ("drawn", "value", "stream", "where"),
        [(draw.path or draw.name, _text(draw.value), draw.stream, draw.where) for draw in found.draws],
    )
    if not found.draws:
        typer.echo("nothing in this file is random")
    typer.echo(f"episode seed {found.episode_seed}")


def _text(value: object) -> str:
    if isinstance(value, tuple):
        return " ".join(map(_text, value))
    return f"{value:.6g}" if isinstance(value, float) else str(value)
