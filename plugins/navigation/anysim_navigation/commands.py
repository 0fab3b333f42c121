"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl(trylast=True)
def add_cli(app: "typer.Typer") -> None:
    """`anysim map`, and `anysim bench navmesh` and `navigate` where anysim-bench has made the group."""
    from anysim_navigation import cli

    app.command("map")(cli.make_map)
    for group in app.registered_groups:
        if group.name == "bench" and group.typer_instance is not None:
            group.typer_instance.command("navmesh")(cli.navmesh)
            group.typer_instance.command("navigate")(cli.navigate)
