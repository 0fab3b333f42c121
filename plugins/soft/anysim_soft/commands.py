"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl, join_group

if TYPE_CHECKING:
    import typer


@hookimpl(trylast=True)
def add_cli(app: "typer.Typer") -> None:
    """`anysim bench soft`, where anysim-bench has made the group."""
    from anysim_soft import cli

    join_group(app, "bench", soft=cli.soft)
