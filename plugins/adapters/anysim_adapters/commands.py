"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl
def add_cli(app: "typer.Typer") -> None:
    """`anysim openenv` and `anysim openpi`."""
    from anysim_adapters.cli import openenv, openpi

    app.command("openenv")(openenv.openenv)
    app.command("openpi")(openpi.openpi)
