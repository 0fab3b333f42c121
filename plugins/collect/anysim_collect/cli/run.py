"""`anysim run`: collect episodes of tasks with their experts. `anysim report`: what became of them."""

from collections.abc import Sequence
from contextlib import ExitStack, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from anysim.cli.options import BROKE, AsJson, Engine, NumEnvs, Overrides, Robot, Seed, Verbose, with_robot
from anysim_collect.mixture import Balance
from anysim_processes.options import PROCESSES, Executor, Workers

if TYPE_CHECKING:
    from anysim.task.env import TaskEnv
    from anysim_collect.endings import Ran
    from anysim_collect.mixture import Limits, Part
    from anysim_collect.turns import Collection
    from anysim_recording.collector import EpisodeResult

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
    balance: Annotated[
        Balance,
        typer.Option(
            help="What several tasks get by their weights: episodes; or kept segments, or CPU seconds, by stored costs."
        ),
    ] = Balance.EPISODES,
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
    view: Annotated[
        bool, typer.Option("--view", help="Show the envs in a browser while they run; the address is printed.")
    ] = False,
    executor: Executor = None,
    workers: Workers = None,
    verbose: Verbose = False,
    json: AsJson = False,
) -> None:
    """Run the experts of tasks, or their commands, and keep the trajectories that succeed.

    Every trajectory is a directory with a manifest, an MCAP file and a video for each recorded camera. Running the same
    command again goes on where an interrupted one stopped. At the end `report.json` and `report.html` beside the
    trajectories say what succeeded, what failed and why, and where the time went.

    Examples:
      anysim run pick_cube --num-envs 16 --episodes 64 --seed 1
      anysim run stack_cube --robot ur5_gripper --view
      anysim run pick_cube -o world.objects.cube.mass=0.3 --out runs/heavy
      anysim run pick_cube=3 push_cube=1 --num-envs 16 --hours 2 --bytes 20GB --out runs/mixed
      anysim run pick_cube put_away --balance segments --num-envs 16 --episodes 64 --out runs/mixed
      anysim run pick_cube --num-envs 4 --episodes 64 --executor ray
    """
    from anysim.record.commit import file_at, no_directory
    from anysim_collect.balance import balanced
    from anysim_collect.endings import tell, tell_mixture
    from anysim_collect.live import showing
    from anysim_collect.mixture import UNBOUNDED, Limits, mixture, parse_bytes, shared_out
    from anysim_collect.turns import collect

    if out is not None and (file := file_at(out)) is not None:
        raise no_directory("--out", file)
    parts, overrides = mixture(tasks), with_robot(override, robot)
    if balance is not Balance.EPISODES:
        parts = balanced(parts, [engine or _own_engine(part.task, overrides) for part in parts], balance)
    if len(parts) > 1 and not json:
        shares = ", ".join(f"{part.task} {part.share:.1%}" for part in parts)
        typer.echo(f"shares of the episodes, to balance {balance}: {shares}")
    limits = Limits(hours, None if max_bytes is None else parse_bytes(max_bytes))
    bounded = hours is not None or max_bytes is not None
    total = episodes if episodes is not None else UNBOUNDED if bounded else 1
    ordered = [
        (
            Order(part, engine, num_envs, seed, overrides, strict_observers, view, verbose, json),
            out if out is None or len(parts) == 1 else out / Path(part.task).stem,
            count,
            None if bounded and episodes is None else count,
        )
        for part, count in zip(parts, shared_out(parts, total), strict=True)
        if count > 0
    ]
    if executor is not None or workers is not None:
        runs = _run_shared(ordered, limits, balance, executor or PROCESSES, workers)
    else:
        with ExitStack() as stack:
            collections = [_begin(stack, *one, limits) for one in ordered]
            with showing(collections, json) as show:
                collect(collections, show)
            runs = _end(collections, balance)
    if json:
        _print_json(runs)
    else:
        for ran in runs:
            tell(ran)
        tell_mixture(runs[0].mixture)
    if any(ran.tally.lost for ran in runs):
        raise typer.Exit(BROKE)
    if sum(ran.tally.successes for ran in runs) < min_success * sum(ran.tally.attempts for ran in runs):
        raise typer.Exit(1)


def report(
    directory: Annotated[
        Path,
        typer.Argument(
            metavar="DIR", help="A run's directory, or one that holds those of several tasks: as of `anysim run --out`."
        ),
    ],
    json: AsJson = False,
) -> None:
    """Say what became of the episodes of a run: success by command, failures by type, retries, cost, shares of tasks.

    Examples:
      anysim report runs/heavy
      anysim report runs/mixed
    """
    from anysim.cli.output import print_json
    from anysim_collect.endings import tell_mixture, tell_report
    from anysim_collect.report import read_reports

    reports = read_reports(directory)
    if json:
        print_json(reports[directory] if directory in reports else {"runs": list(reports.values())})
        return
    for place, told in reports.items():
        tell_report(place, told)
    tell_mixture(next(iter(reports.values())).get("mixture", {}))


class Order(NamedTuple):
    """One task to be run, and how."""

    part: "Part"
    engine: str | None
    num_envs: int | None
    seed: int | None
    overrides: Sequence[str]
    strict_observers: bool
    view: bool
    verbose: bool
    json: bool


def _begin(
    stack: ExitStack, order: Order, out: Path | None, episodes: int, total: int | None, limits: "Limits"
) -> "Collection":
    """Make the env of a task, which closes with the stack, and what collects with it."""
    from anysim import registry
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
    if order.view:
        shown = stack.enter_context(registry.load("views", "page")(env))
        typer.echo(f"view of {env.name}: {shown.url}", err=order.json)
    seed = env.spec.seed if order.seed is None else order.seed
    directory = out or Path("runs") / run_name(env.name, env.engine.name, env.spec.to_dict(), seed)
    made = Collection(env, directory, episodes, seed, limits, share=order.part.share, total=total)
    stack.callback(made.close)
    if not order.json:
        present = len(made.collector.recorder.committed())
        _announce(env, directory, total, seed, present, order.verbose, task)
    return made


def _run_shared(
    ordered: "Sequence[tuple[Order, Path | None, int, int | None]]",
    limits: "Limits",
    balance: Balance,
    executor: str,
    workers: int | None,
) -> "list[Ran]":
    """Have the tasks collected by the workers of an executor."""
    from anysim.cli.output import counting
    from anysim.errors import TaskError
    from anysim_collect.live import line
    from anysim_collect.sharing import SharedCollection, collect_shared, ended, shared_job

    with ExitStack() as stack:
        collections: list[SharedCollection] = []
        for order, out, episodes, total in ordered:
            if order.view:
                raise TaskError("--view shows envs of this process, and --executor has them elsewhere; leave one out")
            task, share = order.part
            job, own = shared_job(task, order.engine, order.num_envs, order.seed, order.overrides)
            job = job._replace(episodes=episodes, strict_observers=order.strict_observers)
            one = SharedCollection(job, out or own, share, total)
            stack.callback(one.keeper.close)
            collections.append(one)
            if not order.json:
                count = "episodes" if total is None else f"{total} episodes"
                typer.echo(
                    f"{task} on {job.engine}: {count} in rounds of {job.num_envs}, seed {job.seed}, by {executor}"
                )
                there = f" (resuming: {len(one.there)} are there already)" if one.there else ""
                typer.echo(f"trajectories: {one.out}{there}")
        quiet, several = ordered[0][0].json, len(ordered) > 1
        left = sum(one.job.episodes if one.total is None else one.total for one in collections)
        with counting("episodes", left - sum(len(one.there) for one in collections), quiet) as show:

            def tell(task: str, result: "EpisodeResult") -> None:
                won, tried = (sum(getattr(c.tally, of) for c in collections) for of in ("successes", "attempts"))
                show(f"{task}: {line(result)}" if several else line(result), f"{won} of {tried} succeeded")

            wall = collect_shared(collections, limits, executor, workers, tell)
        return ended(collections, balance, wall, limits.reached())


def _end(collections: "Sequence[Collection]", balance: Balance) -> "list[Ran]":
    """Write the reports of collections that have ended."""
    from anysim_collect.endings import Ran
    from anysim_collect.report import mixed, write_report

    reports = [_report(one) for one in collections]
    mixture = mixed(reports, [one.share for one in collections], balance)
    ended: list[Ran] = []
    for one, report in zip(collections, reports, strict=True):
        page = write_report(one.out, report | {"mixture": mixture})
        results, steps = sorted(one.results, key=lambda r: (r.env, r.episode)), one.collector.times.steps
        ended.append(Ran(one.out, results, one.tally, steps, report["wall_s"], one.limits.reached(), page, mixture))
    return ended


def _report(one: "Collection") -> dict[str, Any]:
    from anysim_collect.report import report_of

    env = one.env
    what = {
        "task": env.name,
        "engine": env.engine.name,
        "engine_version": f"{env.engine.name} {env.engine.version}",
        "num_envs": env.num_envs,
        "seed": one.seed,
    }
    return report_of(what, one.tally, one.collector.times.parts(one.wall), one.cpu, one.planners)


def _own_engine(task: str, overrides: Sequence[str]) -> str:
    """The engine that a task's file names."""
    from anysim.api import load

    return load(task, overrides=overrides).spec.engine.name


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


def _print_json(runs: "Sequence[Ran]") -> None:
    from anysim.cli.output import print_json
    from anysim_collect.endings import as_data

    told = [as_data(ran) for ran in runs]
    print_json(told[0] if len(told) == 1 else {"runs": told, "mixture": runs[0].mixture})
