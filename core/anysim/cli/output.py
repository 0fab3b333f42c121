"""Tables on a terminal, plain tab-separated lines in a pipe."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol

import typer

if TYPE_CHECKING:
    from anysim.engine.capability import Capabilities, Need
    from anysim.model.world import World


def interactive() -> bool:
    """Whether a person is looking at stdout."""
    import sys

    return sys.stdout.isatty()


def print_json(data: Any) -> None:
    """One JSON document, keys in the order given."""
    typer.echo(json.dumps(data, indent=2, default=str))


def print_table(
    title: str, columns: Sequence[str], rows: Sequence[Sequence[Any]], styles: Mapping[str, str] | None = None
) -> None:
    """A table for people, cells in the colour that `styles` gives their text; in a pipe lines separated by tabs."""
    cells = [["" if cell is None else str(cell) for cell in row] for row in rows]
    if not interactive():
        typer.echo("\t".join(columns))
        for row in cells:
            typer.echo("\t".join(row))
        return
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(title=title, title_justify="left", header_style="bold")
    for column in columns:
        table.add_column(column)
    for row in cells:
        table.add_row(*(Text(cell, (styles or {}).get(cell, "")) for cell in row))
    Console().print(table)


def approximations(
    engine: str, capabilities: "Capabilities", needs: "Sequence[Need]", verbose: bool, command: str
) -> list[str]:
    """The needs that an engine meets approximately: a line with the measured error of each, or one with their count.

    `command` is what prints them all.
    """
    if verbose or not needs:
        return [f"approximate: {n.capability} ({n.why}): {capabilities.supported[n.capability].note}" for n in needs]
    names = ", ".join(dict.fromkeys(str(need.capability) for need in needs))
    return [f"approximate on {engine}: {len(needs)} ({names}); `{command} -v` says how far, each measured"]


def import_notes(world: "World", verbose: bool, command: str) -> list[str]:
    """What sources of a world say that is not so in it: a line each, or one with their count.

    `command` is what prints them all.
    """
    if verbose or not world.notes:
        return [f"imported: {thing}: {note}" for thing, note in world.notes]
    names = ", ".join(dict.fromkeys(thing for thing, _ in world.notes))
    return [f"imported: {len(world.notes)} notes of what sources say and the world does not ({names}); `{command} -v`"]


@contextmanager
def working_on(what: str, in_a_pipe: bool = False) -> Iterator[Callable[[str], object]]:
    """A spinner with a few words while something takes seconds; in a pipe, lines on stderr or nothing.

    What it gives is called with other words when what is done changes.
    """
    import sys

    if not sys.stderr.isatty():
        yield (lambda words: typer.echo(f"{words}…", err=True)) if in_a_pipe else (lambda words: None)
        return
    from rich.console import Console

    with Console(stderr=True).status(f"{what}…") as status:
        yield lambda words: status.update(f"{words}…")


class Counter(Protocol):
    """What is called once per finished thing: its line, and a few words on how all of it goes."""

    def __call__(self, line: str, standing: str = "") -> object: ...


@contextmanager
def counting(what: str, total: int, quiet: bool = False) -> Iterator[Counter]:
    """Call what it gives once per finished thing: a progress bar for a person, the line in a pipe, else nothing."""
    if quiet:
        yield lambda line, standing="": None
        return
    if not interactive():
        yield lambda line, standing="": typer.echo(line)
        return
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    with Progress(
        TextColumn(what),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[standing]}"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    ) as progress:
        bar = progress.add_task(what, total=total, standing="")
        yield lambda line, standing="": progress.update(bar, advance=1, standing=standing)
