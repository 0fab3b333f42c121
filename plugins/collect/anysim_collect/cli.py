"""`anysim run`: collect episodes of tasks with their experts. `anysim report`: what became of them."""

from collections.abc import Sequence
from contextlib import ExitStack, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from anysim.cli.options import BROKE, AsJson, Engine, NumEnvs, Overrides, Robot, Seed, Verbose, with_robot

if TYPE_CHECKING:
    from anysim.record.collector import EpisodeResult
    from anysim.task.env import TaskEnv
    from anysim_collect.mixture import Limits, Part
    from anysim_collect.tally import Tally
    from anysim_collect.turns import Collection

Tasks = Annotated[
    list[str],
    typer.Argument(
        metavar="TASK[=WEIGHT]", help="Installed tasks (`anysim list tasks`) or YAML files; several share the episodes."
    ),
]


def run(
    tasks: Tasks,
    engine: Engine = None,
    num_envs: NumEnvs = None,
    episodes: Annotated[
        int | None,
        typer.Option(
            "--episodes",
            "-k",
            min=1,
            help="Episodes to attempt, over all envs. [default: 1, or as many as --hours or --bytes allow]",
        ),
    ] = None,
    hours: Annotated[
        float | None, typer.Option(min=0.0001, help="Begin no episode after so many hours; those begun are ended.")
    ] = None,
    max_bytes: Annotated[
        str | None, typer.Option("--bytes", metavar="SIZE", help="The same, once 500MB, 2GB… are kept.")
    ] = None,
    seed: Seed = None,
    robot: Robot = None,
    override: Overrides = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Directory of the trajectories; default runs/<task>-<engine>-<id>. Several tasks have one each in it."
        ),
    ] = None,
    min_success: Annotated[
        float, typer.Option(min=0.0, max=1.0, help="Exit with 1 if a smaller share succeeds.")
    ] = 0.0,
    strict_observers: Annotated[
        bool, typer.Option("--strict-observers", help="End the run where an observer raises, instead of a warning.")
    ] = False,
    verbose: Verbose = False,
    json: AsJson = False,
) -> None:
    """Run the experts of tasks, or their commands, and keep the trajectories that succeed.

    Every trajectory is a directory with a manifest, an MCAP file and a video for each recorded camera. Running the same
    command again goes on where an interrupted one stopped. At the end `report.json` and `report.html` beside the
    trajectories say what succeeded, what failed and why, and where the time went.

    Examples:
      anysim run pick_cube --num-envs 16 --episodes 64 --seed 1
      anysim run stack_cube --robot ur5_gripper
      anysim run pick_cube -o world.objects.cube.mass=0.3 --out runs/heavy
      anysim run pick_cube=3 push_cube=1 --num-envs 16 --hours 2 --bytes 20GB --out runs/mixed
    """
    from anysim.record.commit import file_at, no_directory
    from anysim_collect.live import showing
    from anysim_collect.mixture import UNBOUNDED, Limits, mixture, parse_bytes, shared_out
    from anysim_collect.turns import collect

    if out is not None and (file := file_at(out)) is not None:
        raise no_directory("--out", file)
    parts, overrides = mixture(tasks), with_robot(override, robot)
    limits = Limits(hours, None if max_bytes is None else parse_bytes(max_bytes))
    bounded = hours is not None or max_bytes is not None
    total = episodes if episodes is not None else UNBOUNDED if bounded else 1
    with ExitStack() as stack:
        collections: list[Collection] = []
        for part, count in zip(parts, shared_out(parts, total), strict=True):
            if count == 0:
                continue
            order = Order(part, engine, num_envs, seed, overrides, strict_observers, verbose, json)
            own = out if out is None or len(parts) == 1 else out / Path(part.task).stem
            ends = bounded and episodes is None
            collections.append(_begin(stack, order, own, count, None if ends else count, limits))
        with showing(collections, json) as show:
            collect(collections, show)
        runs = [_end(one) for one in collections]
    if not json:
        for ran in runs:
            _tell(ran)
    if json:
        _print_json(runs)
    if any(ran.tally.lost for ran in runs):
        raise typer.Exit(BROKE)
    if sum(ran.tally.successes for ran in runs) < min_success * sum(ran.tally.attempts for ran in runs):
        raise typer.Exit(1)


def report(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="A run's directory, as of `anysim run --out`.")],
    json: AsJson = False,
) -> None:
    """Say what became of the episodes of a run: success by command, failures by type, retries, cost.

    Examples:
      anysim report runs/heavy
    """
    from anysim.cli.output import print_json, print_table
    from anysim_collect.report import PAGE_FILE, read_report

    told = read_report(directory)
    if json:
        print_json(told)
        return
    low, high = told["interval"]
    typer.echo(
        f"{told['task']} on {told['engine']}: {told['successes']} of {told['attempts']} ({low:.0%} to {high:.0%})"
    )
    print_table(
        "By command",
        ("command", "begun", "succeeded", "failures"),
        [(c["command"], c["begun"], c["succeeded"], _counts(c["failures"])) for c in told["commands"]],
    )
    for title, counts in (("Failures", told["failures"]), ("Retries", told["ladder"])):
        if counts:
            print_table(title, ("type", "times"), list(counts.items()))
    if told["planning"]:
        print_table("Planning", ("", ""), [(name, f"{value:.3g}") for name, value in told["planning"].items()])
    typer.echo(f"the page: {directory / PAGE_FILE}")


class Order(NamedTuple):
    """One task to be run, and how."""

    part: "Part"
    engine: str | None
    num_envs: int | None
    seed: int | None
    overrides: Sequence[str]
    strict_observers: bool
    verbose: bool
    json: bool


class Ran(NamedTuple):
    """A run that has ended. `stopped` is the limit that ended it, in words."""

    directory: Path
    results: "list[EpisodeResult]"
    tally: "Tally"
    steps: int
    parts: dict[str, float]
    stopped: str
    page: Path


def _begin(
    stack: ExitStack, order: Order, out: Path | None, episodes: int, total: int | None, limits: "Limits"
) -> "Collection":
    """Make the env of a task, which closes with the stack, and what collects with it."""
    from anysim.api import make
    from anysim.cli.output import working_on
    from anysim.record.names import run_name
    from anysim.task.cost import MANY
    from anysim_collect.turns import Collection

    task, many = order.part.task, (order.num_envs or 1) >= MANY
    with working_on(f"building {task}") if many else nullcontext():
        env = stack.enter_context(
            make(
                task,
                engine=order.engine,
                num_envs=order.num_envs,
                overrides=order.overrides,
                strict_observers=order.strict_observers,
            )
        )
    seed = env.spec.seed if order.seed is None else order.seed
    directory = out or Path("runs") / run_name(env.name, env.engine.name, env.spec.to_dict(), seed)
    made = Collection(env, directory, episodes, seed, limits, share=order.part.share, total=total)
    stack.callback(made.close)
    if not order.json:
        present = len(made.collector.recorder.committed())
        _announce(env, directory, total, seed, present, order.verbose, task)
    return made


def _end(one: "Collection") -> Ran:
    """Write the report of a collection that has ended."""
    from anysim_collect.report import report_of, write_report

    env, results = one.env, sorted(one.results, key=lambda r: (r.env, r.episode))
    what = {
        "task": env.name,
        "engine": env.engine.name,
        "engine_version": f"{env.engine.name} {env.engine.version}",
        "num_envs": env.num_envs,
        "seed": one.seed,
    }
    parts = one.collector.times.parts(one.wall)
    page = write_report(one.out, report_of(what, one.tally, parts, one.cpu, one.planners))
    return Ran(one.out, results, one.tally, one.collector.times.steps, parts, one.limits.reached(), page)


def _announce(
    env: "TaskEnv", directory: Path, episodes: int | None, seed: int, present: int, verbose: bool, task: str
) -> None:
    from anysim.cli.output import approximations

    count = "episodes" if episodes is None else f"{episodes} episodes"
    typer.echo(f"{env.name} on {env.engine.name} {env.engine.version}: {count} in {env.num_envs} envs, seed {seed}")
    engine = env.engine
    check = f"anysim check {task} -e {engine.name}"
    for line in approximations(engine.name, engine.capabilities, engine.approximations, verbose, check):
        typer.echo(line)
    typer.echo(f"trajectories: {directory}" + (f" (resuming: {present} are there already)" if present else ""))


def _print_json(runs: Sequence[Ran]) -> None:
    from anysim.cli.output import print_json

    told = [_plain(ran) for ran in runs]
    print_json(told[0] if len(told) == 1 else {"runs": told})


def _plain(ran: Ran) -> dict[str, Any]:
    results, tally = ran.results, ran.tally
    episodes = [
        {
            "env": r.env,
            "episode": r.episode,
            "episode_seed": r.episode_seed,
            "status": r.status,
            "steps": r.steps,
            "total_reward": r.total_reward,
            "outcome": r.outcome,
            "path": str(r.path) if r.path else None,
            "resumed": r.resumed,
            "reruns": r.reruns,
            "lost": r.lost,
            "fault": r.fault,
        }
        for r in results
    ]
    wall = sum(ran.parts.values())
    speed = {"steps": ran.steps, "wall_s": wall, "steps_per_s": ran.steps / wall, "where_s": ran.parts}
    counts = {"attempts": tally.attempts, "successes": tally.successes, "reruns": sum(r.reruns for r in results)}
    counts |= {"lost": tally.lost, "faults": sum(bool(r.fault) for r in results)}
    return {"out": str(ran.directory), **counts, "episodes": episodes, "speed": speed, "report": str(ran.page)}


def _tell(ran: Ran) -> None:
    from anysim.cli.output import print_table

    results, tally, steps = ran.results, ran.tally, ran.steps
    faults = [r for r in results if r.fault]
    wall = sum(ran.parts.values())
    if len(results) <= MOST_ROWS:
        print_table(
            "Episodes",
            ("env", "episode", "status", "steps", "return", "attempts", "last phase"),
            [_row(r) for r in results],
        )
    if tally.failures or len(tally.commands) > 1:
        print_table(
            "By command",
            ("command", "begun", "succeeded", "failures"),
            [(c["command"], c["begun"], c["succeeded"], _counts(c["failures"])) for c in tally.to_dict()["commands"]],
        )
    if steps:
        print_table(
            "Where the time went",
            ("part", "seconds", "share"),
            [(part, f"{seconds:.2f}", f"{seconds / wall:.1%}") for part, seconds in ran.parts.items()],
        )
        typer.echo(f"{steps:,} control steps in {wall:.1f} s: {steps / wall:,.0f} steps/s")
    if reruns := sum(r.reruns for r in results):
        typer.echo(f"{reruns} times an episode lost its worker process and was begun anew: no failures of the task")
    if faults:
        first = f"env {faults[0].env} episode {faults[0].episode}: {faults[0].fault}"
        typer.echo(f"{len(faults)} of the attempts ended in a fault of the simulation; the first: {first}", err=True)
    if tally.lost:
        typer.echo(f"error: {tally.lost} episodes lost every worker process they had, and were given up", err=True)
    if ran.stopped:
        typer.echo(f"ended at the limit of {ran.stopped}")
    total = tally.attempts
    rate = f"{tally.successes / total:.1%}" if total else "none"
    typer.echo(
        f"{tally.successes} of {total} attempts succeeded ({rate}); "
        f"{tally.kept} trajectories in {ran.directory / 'episodes'}; the report: {ran.page}"
    )


MOST_ROWS = 200
"""Episodes that are listed one by one; of more the report tells."""


def _row(r: "EpisodeResult") -> tuple[Any, ...]:
    return (
        r.env,
        r.episode,
        r.status,
        r.steps,
        f"{r.total_reward:.2f}",
        r.outcome.get("attempt"),
        r.outcome.get("phase"),
    )


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{count} {why}" for why, count in counts.items())
