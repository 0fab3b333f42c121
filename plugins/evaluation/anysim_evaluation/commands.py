"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl
def add_cli(app: "typer.Typer") -> None:
    """`anysim evaluate` and `anysim benchmark`."""
    from anysim_evaluation.cli import benchmark, evaluate

    app.command("evaluate")(evaluate.evaluate)
    app.add_typer(benchmark.app, name="benchmark")
