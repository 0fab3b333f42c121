"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl, join_group

if TYPE_CHECKING:
    import typer


@hookimpl(trylast=True)
def add_cli(app: "typer.Typer") -> None:
    """`anysim map`, and `anysim bench navmesh` and `navigate` where anysim-bench has made the group."""
    from anysim_navigation import cli

    app.command("map")(cli.make_map)
    join_group(app, "bench", navmesh=cli.navmesh, navigate=cli.navigate)
