"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl
def add_cli(app: "typer.Typer") -> None:
    """`anysim train` and `anysim curves`."""
    from anysim_learning import cli

    app.command("train")(cli.train)
    app.command("curves")(cli.curves)
