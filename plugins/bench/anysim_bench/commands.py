"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl
def add_cli(app: "typer.Typer") -> None:
    """`anysim bench`."""
    from anysim_bench import cli
    from anysim_bench.record import record

    cli.app.command("record")(record)
    app.add_typer(cli.app, name="bench")
