"""`anysim run`: collect episodes of a task with its expert."""

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from anysim.cli.options import BROKE, AsJson, Engine, NumEnvs, Overrides, Seed, Task, Verbose

if TYPE_CHECKING:
    from anysim.record.collector import EpisodeResult
    from anysim.task.env import TaskEnv


def run(
    task: Task,
    engine: Engine = None,
    num_envs: NumEnvs = None,
    episodes: Annotated[int, typer.Option("--episodes", "-k", min=1, help="Episodes to attempt, over all envs.")] = 1,
    seed: Seed = None,
    override: Overrides = None,
    out: Annotated[
        Path | None, typer.Option(help="Directory of the trajectories; default runs/<task>-<engine>-<id>.")
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
    """Run a task's expert, and keep the trajectories that succeed.

    Every trajectory is a directory with a manifest, an MCAP file and a video for each recorded camera. Running the same
    command again goes on where an interrupted one stopped.

    Examples:
      anysim run pick_cube --num-envs 16 --episodes 64 --seed 1
      anysim run pick_cube -o world.objects.cube.mass=0.3 --out runs/heavy
    """
    from anysim.api import make
    from anysim.cli.output import working_on
    from anysim.record.collector import Collector
    from anysim.record.commit import file_at, no_directory
    from anysim.skills.runner import SkillPolicy
    from anysim.task.cost import MANY

    more = override or ()
    if out is not None and (file := file_at(out)) is not None:
        raise no_directory("--out", file)
    with working_on(f"building {task}") if (num_envs or 1) >= MANY else nullcontext():
        made = make(task, engine=engine, num_envs=num_envs, overrides=more, strict_observers=strict_observers)
    with made as env:
        seed = env.spec.seed if seed is None else seed
        directory = out or Path("runs") / f"{env.name}-{env.engine.name}-{_run_id(env, seed)}"
        collector = Collector(env, SkillPolicy(env), directory, episodes, seed)
        if not json:
            _announce(env, directory, episodes, seed, len(collector.recorder.committed()), verbose, task)
        results: list[EpisodeResult] = []
        with _progress(episodes, json) as show:
            for result in collector.run():
                results.append(result)
                show(result)
    results.sort(key=lambda r: (r.env, r.episode))
    _report(results, directory, collector.times.steps, collector.times.parts(), json)
    run_through = [r for r in results if not r.lost]
    if len(run_through) < len(results):
        raise typer.Exit(BROKE)
    if sum(r.success for r in run_through) < min_success * len(run_through):
        raise typer.Exit(1)


def _run_id(env: "TaskEnv", seed: int) -> str:
    """A short name for what is run: the same command gives the same directory, another spec another one."""
    import hashlib
    from json import dumps

    text = dumps([env.spec.to_dict(), seed])
    return f"seed{seed}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"


def _announce(
    env: "TaskEnv", directory: Path, episodes: int, seed: int, present: int, verbose: bool, task: str
) -> None:
    from anysim.cli.output import approximations

    typer.echo(
        f"{env.name} on {env.engine.name} {env.engine.version}: {episodes} episodes in {env.num_envs} envs, seed {seed}"
    )
    engine = env.engine
    check = f"anysim check {task} -e {engine.name}"
    for line in approximations(engine.name, engine.capabilities, engine.approximations, verbose, check):
        typer.echo(line)
    typer.echo(f"trajectories: {directory}" + (f" (resuming: {present} are there already)" if present else ""))


@contextmanager
def _progress(total: int, quiet: bool) -> Iterator[Any]:
    """What is told of each episode that has ended."""
    from anysim.cli.output import counting

    with counting("episodes", total, quiet) as told:
        good = 0

        def show(result: "EpisodeResult") -> None:
            nonlocal good
            good += result.success
            told(_line(result), f"{good} succeeded")

        yield show


def _line(result: "EpisodeResult") -> str:
    kept = f" -> {result.path}" if result.path else ""
    return f"env {result.env} episode {result.episode}: {result.status} in {result.steps} steps{kept}"


def _report(
    results: "list[EpisodeResult]", directory: Path, steps: int, parts: dict[str, float], as_json: bool
) -> None:
    from anysim.cli.output import print_json, print_table

    lost, reruns = sum(r.lost for r in results), sum(r.reruns for r in results)
    faults = [r for r in results if r.fault]
    good, total = sum(r.success for r in results), len(results) - lost
    wall = sum(parts.values())
    if as_json:
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
        speed = {"steps": steps, "wall_s": wall, "steps_per_s": steps / wall, "where_s": parts}
        counts = {"attempts": total, "successes": good, "reruns": reruns, "lost": lost, "faults": len(faults)}
        print_json({"out": str(directory), **counts, "episodes": episodes, "speed": speed})
        return
    print_table(
        "Episodes",
        ("env", "episode", "status", "steps", "return", "attempts", "last phase"),
        [
            (
                r.env,
                r.episode,
                r.status,
                r.steps,
                f"{r.total_reward:.2f}",
                r.outcome.get("attempt"),
                r.outcome.get("phase"),
            )
            for r in results
        ],
    )
    if steps:
        print_table(
            "Where the time went",
            ("part", "seconds", "share"),
            [(part, f"{seconds:.2f}", f"{seconds / wall:.1%}") for part, seconds in parts.items()],
        )
        typer.echo(f"{steps:,} control steps in {wall:.1f} s: {steps / wall:,.0f} steps/s")
    if reruns:
        typer.echo(f"{reruns} times an episode lost its worker process and was begun anew: no failures of the task")
    if faults:
        first = f"env {faults[0].env} episode {faults[0].episode}: {faults[0].fault}"
        typer.echo(f"{len(faults)} of the attempts ended in a fault of the simulation; the first: {first}", err=True)
    if lost:
        typer.echo(f"error: {lost} episodes lost every worker process they had, and were given up", err=True)
    kept = sum(r.path is not None for r in results)
    rate = f"{good / total:.1%}" if total else "none"
    typer.echo(f"{good} of {total} attempts succeeded ({rate}); {kept} trajectories in {directory / 'episodes'}")
