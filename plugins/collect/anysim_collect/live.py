"""Progress of a collection: a table on a terminal, a line for each episode in a pipe."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import typer

from anysim.cli.output import interactive
from anysim.math.statistics import wilson
from anysim_collect.tally import ordered
from anysim_collect.turns import Collection
from anysim_recording.collector import EpisodeResult

REFRESH = 4
"""[Hz] of the table."""


Show = Callable[[Collection, EpisodeResult], None]
"""Called once an episode has ended, and counted."""


def line(result: EpisodeResult) -> str:
    """One episode in words."""
    kept = f" -> {result.path}" if result.path else ""
    return f"env {result.env} episode {result.episode}: {result.status} in {result.steps} steps{kept}"


@contextmanager
def showing(collections: Sequence[Collection], quiet: bool) -> Iterator[Show]:
    """Show how collections grow."""
    several = len(collections) > 1
    if quiet:
        yield lambda one, result: None
        return
    if not interactive():
        yield lambda one, result: typer.echo(f"{one.env.name}: {line(result)}" if several else line(result))
        return
    from rich.console import Group
    from rich.live import Live

    def table() -> Any:
        return Group(*(_table(one) for one in collections))

    with Live(get_renderable=table, refresh_per_second=REFRESH, transient=True):
        yield lambda one, result: None


def _table(one: Collection) -> Any:
    from rich.progress_bar import ProgressBar
    from rich.table import Table

    name, total, tally, wall, cpu = one.name, one.total, one.tally, one.wall, one.cpu
    grid = Table.grid(padding=(0, 2))
    new = tally.attempts - tally.resumed
    done = tally.attempts + tally.lost
    count = f"{done:,}" + (f" of {total:,}" if total is not None else "")
    grid.add_row(name, ProgressBar(total, done, width=40) if total is not None else "", f"{count} episodes")
    left = f", {_clock(wall * (total - done) / new)} left" if total is not None and new else ""
    grid.add_row("time", _clock(wall) + left, f"{60.0 * new / wall:,.1f} episodes a minute" if wall else "")
    low, high = wilson(tally.successes, tally.attempts)
    share = f"{tally.successes / tally.attempts:.1%} ({low:.0%} to {high:.0%})" if tally.attempts else "none yet"
    grid.add_row("success", share, f"{tally.kept:,} kept, {tally.kept_bytes / 1e6:,.1f} MB")
    fresh = tally.kept - tally.resumed
    grid.add_row("cost", f"{cpu / fresh:.2f} CPU seconds an episode kept" if fresh else "", "")
    worst = ", ".join(f"{count} {why}" for why, count in list(ordered(tally.failures).items())[:4])
    grid.add_row("failures", worst or "none", f"{tally.faults} faults" if tally.faults else "")
    counts = [service.counts for service in one.planners]
    if counts:
        queue, answered = sum(c.queue for c in counts), sum(c.answered for c in counts)
        late = f"{sum(c.late for c in counts):,} waited for"
        grid.add_row("planner", f"{queue} in the queue, {answered:,} answered", late)
    return grid


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}"
