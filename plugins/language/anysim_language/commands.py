"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl
def add_cli(app: "typer.Typer") -> None:
    """`anysim describe` and `anysim vqa`."""
    from anysim_language.cli import describe, vqa

    app.command("describe")(describe.describe)
    app.command("vqa")(vqa.vqa)
