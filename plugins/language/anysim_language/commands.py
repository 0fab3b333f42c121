"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl
def add_cli(app: "typer.Typer") -> None:
    """`anysim describe`."""
    from anysim_language.cli import describe

    app.command("describe")(describe.describe)
