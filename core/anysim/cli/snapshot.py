"""`anysim snapshot`: files of envs at one moment."""

from pathlib import Path
from typing import Annotated

import typer

from anysim.cli.options import AsJson, Engine

app = typer.Typer(help="Files of envs at one moment: look at them, or take one from a recording.", no_args_is_help=True)


@app.callback()
def _group() -> None:
    pass


@app.command("show")
def show(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="What `save` of a snapshot or a world state wrote.")],
    json: AsJson = False,
) -> None:
    """Check a file against its hashes, and print what it belongs to and what it holds."""
    from anysim.cli.output import print_json, print_table
    from anysim.engine.snapshot_file import made_with, read

    content = read(file)
    if json:
        print_json(
            {
                "kind": content.kind,
                "bytes": content.size,
                "sha256": content.sha256,
                "stamp": content.stamp,
                "made_with": content.made_with,
                "arrays": content.arrays,
            }
        )
        return
    here = made_with()
    rows = [("kind", content.kind), *((k.replace("_", " "), _text(v)) for k, v in content.stamp.items())]
    for name, version in content.made_with.items():
        other = here.get(name, "absent")
        rows.append((name, version if other == version else f"{version} (here {other})"))
    rows += [("bytes", f"{content.size:,}"), ("sha256", content.sha256)]
    print_table(str(file), ("what", "value"), rows)
    print_table("Arrays", ("array", "type and shape"), list(content.arrays.items()))


def _text(value: object) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


@app.command("take")
def take(
    trajectory: Annotated[Path, typer.Argument(metavar="DIR", help="A recorded trajectory.")],
    out: Annotated[Path, typer.Argument(metavar="FILE", help="The file to write.")],
    step: Annotated[int, typer.Option("--step", "-t", min=0, help="The control step; 0 is right after the reset.")] = 0,
    engine: Engine = None,
) -> None:
    """Replay a trajectory up to a step and write a snapshot, from which any number of runs can go on."""
    from anysim.errors import RecordError
    from anysim.record.reader import open_trajectory
    from anysim.record.replay import begin, rebuild

    reader = open_trajectory(trajectory)
    if step > reader.manifest.steps:
        raise RecordError(f"{trajectory} has {reader.manifest.steps} steps, so there is no step {step}")
    with rebuild(reader.manifest, engine) as env:
        begin(env, reader.manifest)
        for action in reader.actions[:step]:
            env.step(action[None])
        path = env.snapshot().save(out)
    typer.echo(f"{path}: step {step} of {trajectory.name}, on {env.engine.name} {env.engine.version}")
