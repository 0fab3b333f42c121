"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl
def add_cli(app: "typer.Typer") -> None:
    """`anysim run` and `anysim report`."""
    from anysim_collect import cli

    app.command("run")(cli.run)
    app.command("report")(cli.report)
