"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl, join_group

if TYPE_CHECKING:
    import typer


@hookimpl(trylast=True)
def add_cli(app: "typer.Typer") -> None:
    """`anysim bench stopping`, where anysim-bench has made the group."""
    from anysim_mobile import cli

    join_group(app, "bench", stopping=cli.stopping)
