"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl, join_group

if TYPE_CHECKING:
    import typer


@hookimpl(trylast=True)
def add_cli(app: "typer.Typer") -> None:
    """`anysim view`; and `anysim bench view`, where anysim-bench has made the group."""
    from anysim_viewer import cli

    app.command("view")(cli.view)
    join_group(app, "bench", view=cli.bench)
