"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl(trylast=True)
def add_cli(app: "typer.Typer") -> None:
    """`anysim bench stopping`, where anysim-bench has made the group."""
    from anysim_mobile import cli

    for group in app.registered_groups:
        if group.name == "bench" and group.typer_instance is not None:
            group.typer_instance.command("stopping")(cli.stopping)
