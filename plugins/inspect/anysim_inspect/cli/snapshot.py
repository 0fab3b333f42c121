"""`anysim snapshot`: files of envs at one moment."""

from pathlib import Path
from typing import Annotated

import typer

from anysim.cli.options import AsJson

app = typer.Typer(help="Files of envs at one moment: look at them, or take one from a recording.", no_args_is_help=True)


@app.callback()
def _group() -> None:
    pass


@app.command("show")
def show(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="What `anysim snapshot take`, or `save` in Python, wrote.")
    ],
    json: AsJson = False,
) -> None:
    """Check a file against its hashes, and print what it belongs to and what it holds.

    Examples:
      anysim snapshot show moment.snapshot
    """
    from anysim.cli.output import print_json, print_table
    from anysim.engine.snapshots.file import made_with, read

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
    trajectory: Annotated[Path, typer.Argument(metavar="DIR", help="A recorded trajectory, or a run with some.")],
    out: Annotated[Path, typer.Argument(metavar="FILE", help="The file to write.")],
    step: Annotated[int, typer.Option("--step", "-t", min=0, help="The control step; 0 is right after the reset.")] = 0,
    name: Annotated[
        str | None, typer.Option("--trajectory", help="Which one of a run, by its folder; default the first.")
    ] = None,
    engine: Annotated[
        str | None, typer.Option("--engine", "-e", help="Another installed engine than that of the recording.")
    ] = None,
) -> None:
    """Replay a trajectory up to a step and write a snapshot, from which any number of runs can go on.

    Examples:
      anysim snapshot take runs/demo/run moment.snapshot --step 40
      anysim snapshot take runs/demo/run moment.snapshot --trajectory env_0001_episode_0000
    """
    from anysim.errors import NameLookupError, RecordError, listing, suggest
    from anysim.record.names import find_trajectories
    from anysim.record.reader import open_trajectory
    from anysim.record.replay import begin, rebuild

    found = {path.name: path for path in find_trajectories([trajectory])}
    if name is not None and name not in found:
        raise NameLookupError(
            f"{trajectory} has no trajectory '{name}'{suggest(name, list(found))} (it has {listing(list(found))})"
        )
    chosen = name or next(iter(found))
    trajectory = found[chosen]
    reader = open_trajectory(trajectory)
    if step > reader.manifest.steps:
        raise RecordError(f"{trajectory} has {reader.manifest.steps} steps, so there is no step {step}")
    with rebuild(reader.manifest, engine) as env:
        begin(env, reader.manifest)
        for action in reader.actions[:step]:
            env.step(action[None])
        path = env.snapshot().save(out)
    of = f" (the first of {len(found)}; --trajectory names another)" if name is None and len(found) > 1 else ""
    typer.echo(f"{path}: step {step} of {chosen}{of}, on {env.engine.name} {env.engine.version}")
