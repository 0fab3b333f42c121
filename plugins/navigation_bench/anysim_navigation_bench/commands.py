"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl, join_group

if TYPE_CHECKING:
    import typer


@hookimpl(trylast=True)
def add_cli(app: "typer.Typer") -> None:
    """`anysim bench navmesh` and `anysim bench navigate`."""
    from anysim_navigation_bench import cli

    join_group(app, "bench", navmesh=cli.navmesh, navigate=cli.navigate)
