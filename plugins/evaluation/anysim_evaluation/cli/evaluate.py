"""`anysim evaluate`: how often a policy solves a task."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from anysim.cli.options import AsJson, Overrides, Robot, Task, with_robot
from anysim_processes.options import PROCESSES, Executor, Workers

if TYPE_CHECKING:
    from anysim_evaluation.driver import Episode

PAGE = "evaluation.html"
MOST_ENVS, ENVS_OF_A_WORKER = 16, 4
"""Envs where their number is not given; it changes the time alone."""


class Question(NamedTuple):
    """What is evaluated, whatever the engine."""

    task: str
    policy: str
    split: str
    seeds: Sequence[int]
    overrides: Sequence[str]
    num_envs: int
    privileged: bool
    executor: str | None = None
    workers: int | None = None


def evaluate(
    task: Task,
    policy: Annotated[
        str,
        typer.Option(
            "--policy",
            "-p",
            help="expert, expert:sigma=0.03, shipped, random, zero, MODULE:FUNCTION, FILE.onnx, or an installed one.",
        ),
    ] = "expert",
    engine: Annotated[
        str | None, typer.Option("--engine", "-e", help="An installed engine, or `all` that can run the task.")
    ] = None,
    episodes: Annotated[int, typer.Option("--episodes", "-k", min=1, help="Episodes on each engine.")] = 50,
    split: Annotated[
        str, typer.Option(help="Which seeds: train (10,000), validation (200) or test (200), for the last comparison.")
    ] = "validation",
    first: Annotated[int, typer.Option("--seed", "-s", min=0, help="The place in the split to begin at.")] = 0,
    level: Annotated[str | None, typer.Option(help="A level of difficulty that the task has.")] = None,
    robot: Robot = None,
    num_envs: Annotated[
        int | None,
        typer.Option(
            "--num-envs", "-n", min=1, help="Parallel environments, by default 16; results do not depend on it."
        ),
    ] = None,
    privileged: Annotated[
        bool, typer.Option("--privileged", help="Show the policy the observations that only a simulator knows, too.")
    ] = False,
    videos: Annotated[
        int, typer.Option(min=0, help="How many first successes, and first failures, are filmed on each engine.")
    ] = 0,
    override: Overrides = None,
    out: Annotated[Path | None, typer.Option(help="Directory of the results; default runs/evaluate-….")] = None,
    executor: Executor = None,
    workers: Workers = None,
    json: AsJson = False,
) -> None:
    """Say how often a policy solves a task, on one engine or on all, from the same episode seeds.

    Each episode is on the disk once it has ended: the same command again goes on where an interrupted one stopped. At
    the end `evaluation.json` and `evaluation.html` have rates with 95 % intervals, by kind and level of the ground
    where it has tiles, failures by type, and how far the engines agree seed by seed.

    BENCHMARK:TASK is a task of an external benchmark (`anysim list benchmarks`), judged by its own rule.

    A function of your own gets the observation groups (n, …) by name and returns actions (n, A), or chunks (n, K, A)
    that are carried out step by step.

    Examples:
      anysim evaluate pick_cube --engine all --episodes 100 --videos 2
      anysim evaluate pick_cube --policy expert:sigma=0.1 --level L2
      anysim evaluate stack_cube --robot ur5_gripper
      anysim evaluate reach --policy my_policies:reach --split test
      anysim evaluate pick_cube --episodes 200 --executor ray
      anysim evaluate maniskill:PickCube-v1 --policy my_policies:pick
    """
    from anysim.cli.output import print_json
    from anysim.errors import AnysimError, TaskError
    from anysim.record.commit import write_whole
    from anysim_evaluation.driver import episode_seeds
    from anysim_evaluation.external.benchmark import is_external
    from anysim_evaluation.page import page
    from anysim_evaluation.summary import agreements, summary

    overrides = [*with_robot(override, robot), *([] if level is None else [f"level={level}"])]
    seeds = episode_seeds(split, first, episodes)
    shared = executor or (None if workers is None else PROCESSES)
    envs = min(num_envs or (MOST_ENVS if shared is None else ENVS_OF_A_WORKER), episodes)
    question = Question(task, policy, split, seeds, overrides, envs, privileged, shared, workers)
    said = [Path(task).stem, policy, *([level] if level else []), *([robot] if robot else []), split]
    folder = out or Path("runs") / "-".join(["evaluate", *map(_plain, said)])
    done: dict[str, dict[int, Episode]] = {}
    films: dict[str, list[str]] = {}
    if is_external(task):
        given = {"--engine": engine, "--level": level, "--robot": robot, "--override": override, "--num-envs": num_envs}
        given |= {"--privileged": privileged, "--videos": videos, "--executor": executor, "--workers": workers}
        _refuse_for_external(task, given)
        done = _evaluate_external(question, folder, json)
    for name in [] if done else _engines(engine):
        try:
            found = (_evaluate if shared is None else _evaluate_shared)(question, name, folder, json)
            done |= found
            films |= _filmed(question, found, videos, folder) if videos else {}
        except AnysimError as error:
            if engine != "all" or isinstance(error, TaskError):
                raise
            typer.echo(f"not on {name}: {error}", err=True)
    if not done:
        raise TaskError(f"no installed engine can run {task}; `anysim check {task} --all-engines` says why")
    told = {
        "format": "anysim-evaluation-1",
        "task": task,
        "policy": policy,
        "level": level,
        "robot": robot,
        "split": split,
        "num_episodes": episodes,
        "engines": {name: summary(list(found.values())) for name, found in done.items()},
        "agreement": agreements(done),
        "videos": films,
    }
    write_whole(folder, {"evaluation.json": dumps(told, indent=2) + "\n", PAGE: page(told)})
    if json:
        print_json(told)
    else:
        _tell(told)
        typer.echo(f"the page: {folder / PAGE}")


def _engines(engine: str | None) -> list[str | None]:
    from anysim.engine.capability import Capability
    from anysim.engine.factory import runnable

    return [*runnable(Capability.DYNAMICS)] if engine == "all" else [engine]


def _plain(text: str) -> str:
    return re.sub(r"[^\w.=]+", "_", text)


def _evaluate(question: Question, engine: str | None, folder: Path, quiet: bool) -> "dict[str, dict[int, Episode]]":
    """The episodes of one engine by seed, those of earlier runs among them."""
    from anysim.api import make
    from anysim_evaluation.driver import drive
    from anysim_evaluation.log import identity
    from anysim_evaluation.policy import make_policy

    overrides = [*question.overrides, "record.cameras=[]"]
    with make(question.task, engine=engine, num_envs=question.num_envs, overrides=overrides) as env:
        driven = make_policy(env, question.policy)
        what = identity(env, question.policy, driven, question.privileged)

        def run(seeds: Sequence[int]) -> "Iterator[Episode]":
            return drive(env, driven, seeds, privileged=question.privileged)

        return {env.engine.name: _logged(question, env.engine.name, folder, what, run, quiet)}


def _evaluate_shared(
    question: Question, engine: str | None, folder: Path, quiet: bool
) -> "dict[str, dict[int, Episode]]":
    """The same, from the workers of an executor; each of them has `num_envs` envs, and as many seeds at a time."""
    from anysim.api import load
    from anysim.cli.output import counting
    from anysim_evaluation import sharing
    from anysim_evaluation.log import FILE, EpisodeLog, read_log
    from anysim_processes.executors import share

    overrides = (*question.overrides, "record.cameras=[]")
    name = engine or load(question.task, overrides=overrides).spec.engine.name
    there = read_log(folder / name / FILE).episodes
    left = [seed for seed in question.seeds if seed not in there]
    asked = sharing.Question(question.task, name, question.num_envs, overrides, question.policy, question.privileged)
    work = [(asked, seeds) for seeds in sharing.portions(left, question.num_envs)]
    won = sum(there[seed].status == "success" for seed in question.seeds if seed in there)
    with ExitStack() as stack:
        tell = stack.enter_context(counting(f"{question.policy} on {question.task}, {name}", len(left), quiet))
        log: EpisodeLog | None = None
        for answer in share(question.executor, work, sharing.answering, question.workers):
            if log is None:
                log = stack.enter_context(EpisodeLog(folder / name, answer.what))
            for episode in answer.episodes:
                log.add(episode)
                won += episode.status == "success"
                tell(f"{name} seed {episode.seed}: {episode.failure or 'success'}", f"{won} solved")
        assert log is not None, "there is always a portion"
        return {name: {seed: log.episodes[seed] for seed in question.seeds}}


def _logged(
    question: Question,
    name: str,
    folder: Path,
    what: Mapping[str, str],
    run: "Callable[[Sequence[int]], Iterator[Episode]]",
    quiet: bool,
) -> "dict[int, Episode]":
    """The episodes of `question` by seed: those that are in the log of `name`, and those that `run` adds to them."""
    from anysim.cli.output import counting
    from anysim_evaluation.log import EpisodeLog

    with EpisodeLog(folder / name, what) as log:
        left = [seed for seed in question.seeds if seed not in log.episodes]
        won = sum(log.episodes[seed].status == "success" for seed in question.seeds if seed in log.episodes)
        with counting(f"{question.policy} on {what['task']}, {name}", len(left), quiet) as tell:
            for episode in run(left):
                log.add(episode)
                won += episode.status == "success"
                tell(f"{name} seed {episode.seed}: {episode.failure or 'success'}", f"{won} solved")
        return {seed: log.episodes[seed] for seed in question.seeds}


def _refuse_for_external(task: str, given: Mapping[str, object]) -> None:
    """An external benchmark has its own engine, levels and pictures: what asks for ours is not left aside silently."""
    from anysim.errors import TaskError

    for option, value in given.items():
        if value:
            raise TaskError(f"{option}: '{task}' is a task of an external benchmark, which takes no such option")


def _evaluate_external(question: Question, folder: Path, quiet: bool) -> "dict[str, dict[int, Episode]]":
    """The episodes of an external task by seed, by the name of its benchmark."""
    from anysim_evaluation.external.benchmark import SEPARATOR, open_task
    from anysim_evaluation.external.driving import drive_external, external_policy

    name = question.task.partition(SEPARATOR)[0]
    benchmark, env = open_task(question.task)
    try:
        policy = external_policy(env, question.policy)
        what = {"task": question.task, "benchmark": benchmark.version, "policy": question.policy}

        def run(seeds: Sequence[int]) -> "Iterator[Episode]":
            return drive_external(env, policy, seeds)

        return {name: _logged(question, name, folder, what, run, quiet)}
    finally:
        env.close()


def _filmed(
    question: Question, done: "Mapping[str, Mapping[int, Episode]]", count: int, folder: Path
) -> dict[str, list[str]]:
    """The videos of one engine's first successes and failures, by its name: paths in `folder`."""
    from anysim.api import make
    from anysim.errors import EngineError
    from anysim_evaluation.policy import make_policy
    from anysim_evaluation.videos import chosen, film

    ((name, episodes),) = done.items()
    with make(question.task, engine=name, num_envs=1, overrides=[*question.overrides, "record.cameras=[]"]) as env:
        wanted, policy = chosen(episodes, count), make_policy(env, question.policy)
        try:
            paths = film(env, policy, wanted, folder / name, privileged=question.privileged)
        except EngineError as error:
            typer.echo(f"no videos on {name}: {error}", err=True)
            paths = []
    return {name: [f"{name}/{path}" for path in paths]}


def _tell(told: Mapping[str, Any]) -> None:
    from anysim.cli.output import print_table
    from anysim_evaluation.summary import ground_table

    def row(name: str, one: Mapping[str, Any]) -> tuple[Any, ...]:
        failures = ", ".join(f"{count} {kind}" for kind, count in one["failures"].items())
        steps = "" if one["steps"] is None else f"{one['steps']:g}"
        solved = f"{one['successes']} of {one['attempts']}"
        return name, solved, "{:.0%} to {:.0%}".format(*one["interval"]), failures or "none", steps, one["faults"]

    engines: Mapping[str, Any] = told["engines"]
    columns = ("engine", "solved", "95 %", "failures", "steps", "faults")
    print_table(f"{told['policy']} on {told['task']}", columns, [row(*entry) for entry in engines.items()])
    for name, one in engines.items():
        if one["ground"]:
            print_table(f"Success by ground, {name}", *ground_table(one["ground"]))
    pairs = [pair for pair in told["agreement"] if pair["seeds"]]
    if pairs:
        rows = [
            (
                f"{pair['first']}, {pair['second']}",
                f"{pair['agree']:.1%}",
                "" if pair["kappa"] is None else f"{pair['kappa']:.2f}",
                f"{pair['only_first']}, {pair['only_second']}",
                f"{pair['p']:.3f}",
            )
            for pair in pairs
        ]
        print_table("Agreement, seed by seed", ("engines", "same outcome", "kappa", "solved by one alone", "p"), rows)
