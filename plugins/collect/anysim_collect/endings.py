"""Endings of runs: what a run says of its episodes, and of how several tasks shared them, as text and as data."""

from pathlib import Path
from typing import Any, NamedTuple

import typer

from anysim.cli.output import print_table
from anysim_collect.report import MIXTURE_COLUMNS, PAGE_FILE, mixture_rows
from anysim_collect.tally import Tally
from anysim_recording.collector import EpisodeResult

MOST_ROWS = 200
"""Episodes that are listed one by one; of more the report tells."""


class Ran(NamedTuple):
    """A run that has ended. `stopped` is the limit that ended it, in words."""

    directory: Path
    results: list[EpisodeResult]
    tally: Tally
    steps: int
    parts: dict[str, float]
    stopped: str
    page: Path
    mixture: dict[str, Any]


def as_data(ran: Ran) -> dict[str, Any]:
    """A run as plain data."""
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


def tell(ran: Ran) -> None:
    """Print how a run went."""
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


def tell_report(directory: Path, told: dict[str, Any]) -> None:
    """Print a report that was read from a directory."""
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


def tell_mixture(mixture: dict[str, Any]) -> None:
    """Print what each of several tasks got; nothing where there was one."""
    if mixture:
        print_table(f"Mixture, to balance {mixture['balance']}", MIXTURE_COLUMNS, mixture_rows(mixture))


def _row(r: EpisodeResult) -> tuple[Any, ...]:
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
