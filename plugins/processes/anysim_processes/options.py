"""The options with which commands take an executor."""

from typing import Annotated

import typer

PROCESSES = "processes"
"""The executor where only the number of workers is given: this machine's."""
Executor = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help="Have it done by workers: `processes` of this machine, or another installed executor, as `ray`.",
    ),
]
Workers = Annotated[
    int | None,
    typer.Option("--workers", "-w", min=1, help="Workers at most. [default: with --executor as many as have room]"),
]
