"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl
def add_cli(app: "typer.Typer") -> None:
    """`anysim openenv`."""
    from anysim_adapters.cli import openenv

    app.command("openenv")(openenv.openenv)
