"""`anysim export`: recorded runs as data sets; `anysim tape`: the actions of a data set played again."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from anysim.cli.options import AsJson, option_values
from anysim_processes.options import Executor

if TYPE_CHECKING:
    from anysim_export.parts import Told


def export(
    directories: Annotated[
        list[Path], typer.Argument(metavar="RUN…", help="Runs of one task and robot, or trajectories of them.")
    ],
    to: Annotated[
        str,
        typer.Option("--to", help="lerobot, robomimic, rlds-ready, coco, webdataset, rerun, foxglove, or another one."),
    ],
    out: Annotated[Path, typer.Option(help="Directory of the data set; nothing in it is ever overwritten.")],
    option: Annotated[
        list[str] | None, typer.Option("--option", help="An option of the exporter, KEY=VALUE; may be repeated.")
    ] = None,
    failed_too: Annotated[
        bool, typer.Option("--failed-too", help="Export committed episodes too that did not succeed.")
    ] = False,
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs", "-j", min=1, help="Processes that write episodes. [default: 1, or as many as --executor has]"
        ),
    ] = None,
    executor: Executor = None,
    json: AsJson = False,
) -> None:
    """Write the committed trajectories of runs as a data set that trainers read.

    The data set becomes visible when it is whole. Interrupted or killed, the same command goes on where it stopped and
    gives the same bytes; once it is done, it says so and changes nothing. Streams of the recordings that the data set
    does not hold are named at the end.

    Examples:
      anysim export runs/pick --to lerobot --out data/pick
      anysim export runs/a runs/b --to robomimic --out data/pick --option valid=0.1
    """
    from anysim.cli.output import counting, print_json
    from anysim_export.job import export as write

    with _Bar(lambda total: counting("episodes", total, quiet=json)) as bar:
        options = option_values(option, "images=false")
        done = write(directories, to, out, options, failed_too=failed_too, jobs=jobs, executor=executor, tell=bar.begin)
    if json:
        print_json({**done._asdict(), "directory": str(done.directory)})
        return
    left = f"; {done.left_out} that did not succeed left out (--failed-too)" if done.left_out else ""
    before = f", {done.resumed} of them written before" if done.resumed else ""
    what = "are there already in" if done.present else "->"
    typer.echo(f"{done.episodes} episodes, {done.frames} steps{before} {what} {done.directory}{left}")
    if done.omitted:
        typer.echo(f"recorded, and not in it: {_families(done.omitted)}")


def _families(streams: Mapping[str, str]) -> str:
    """Streams by families, each with the option that brings it: `state/joint_pos joint_vel (--option states=true)`."""
    found: dict[tuple[str, str], list[str]] = {}
    for name, option in streams.items():
        family, _, rest = name.partition("/")
        found.setdefault((f"{family}/" if rest else "", option), []).append(rest or family)
    return ", ".join(
        f"{family}{' '.join(names)}{f' (--option {option})' if option else ''}"
        for (family, option), names in found.items()
    )


def tape(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="A data set of LeRobot (v3.0).")],
    engine: Annotated[
        str | None, typer.Option("--engine", "-e", help="Another installed engine than that of the recording.")
    ] = None,
    task: Annotated[
        str | None,
        typer.Option(help="A task to play in, where the data set says none of its own (it has no anysim.json)."),
    ] = None,
    seed: Annotated[
        int | None, typer.Option("--seed", "-s", min=0, help="With --task: of the first episode, 0 if not given.")
    ] = None,
    json: AsJson = False,
) -> None:
    """Play the actions of a LeRobot data set, each episode from its own beginning, and say how it came out.

    A data set of `anysim export` knows how its episodes began. The actions in it are float32: states may differ from
    those of the recording, and a tape watches nothing.

    Examples:
      anysim export runs/pick --to lerobot --out data/pick && anysim tape data/pick
      anysim tape data/pick --engine pybullet
      anysim tape data/from_elsewhere --task pick_cube --seed 3
    """
    from anysim.cli.output import counting, print_json
    from anysim_export.tape import play, read_tape

    if seed is not None and task is None:
        raise typer.BadParameter(
            "goes with --task; without it episodes begin as they were recorded", param_hint="--seed"
        )
    reel = read_tape(directory)
    played: list[Any] = []
    with counting("episodes", len(reel.actions), quiet=json) as show:
        for one in play(reel, engine=engine, task=task, seed=seed or 0):
            played.append(one)
            was = f" (recorded: {one.recorded})" if one.recorded else ""
            show(f"episode {one.episode}: {one.status}{was}, {one.steps} steps", f"{len(played)}")
    won, same = (sum(test(one) for one in played) for test in (_won, _same))
    if json:
        print_json({"episodes": [one._asdict() for one in played], "success": won, "as_recorded": same})
        return
    typer.echo(f"{won} of {len(played)} episodes succeed; {same} come out as they were recorded")


def _won(one: Any) -> bool:
    return one.status == "success"


def _same(one: Any) -> bool:
    return one.status == one.recorded


class _Bar:
    """A progress bar that begins once it is known how long it is."""

    def __init__(self, make: Any) -> None:
        from contextlib import ExitStack

        self._make, self._stack = make, ExitStack()

    def begin(self, total: int) -> "Told":
        """Begin it."""
        return self._stack.enter_context(self._make(total))

    def __enter__(self) -> "_Bar":
        return self

    def __exit__(self, *error: Any) -> None:
        self._stack.__exit__(*error)
