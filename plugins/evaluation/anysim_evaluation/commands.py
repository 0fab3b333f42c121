"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl
def add_cli(app: "typer.Typer") -> None:
    """`anysim evaluate` and `anysim benchmark`."""
    from anysim_evaluation import cli
    from anysim_evaluation.benchmark import cli as benchmark

    app.command("evaluate")(cli.evaluate)
    app.add_typer(benchmark.app, name="benchmark")
