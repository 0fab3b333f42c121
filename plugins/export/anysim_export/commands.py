"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl
def add_cli(app: "typer.Typer") -> None:
    """`anysim export` and `anysim tape`."""
    from anysim_export import cli

    app.command("export")(cli.export)
    app.command("tape")(cli.tape)
