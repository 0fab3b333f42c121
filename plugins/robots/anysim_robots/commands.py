"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl
def add_cli(app: "typer.Typer") -> None:
    """`anysim robot` and `anysim gallery`."""
    from anysim_robots.cli import gallery, robot

    app.add_typer(robot.app, name="robot")
    app.command("gallery")(gallery.gallery)
