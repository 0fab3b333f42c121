"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl
def add_cli(app: "typer.Typer") -> None:
    """`anysim compare` and `anysim picture`."""
    from anysim_parity.cli import compare, picture

    app.command("compare")(compare.compare)
    app.command("picture")(picture.picture)
