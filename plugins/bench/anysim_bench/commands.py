"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl
def add_cli(app: "typer.Typer") -> None:
    """`anysim bench`."""
    from anysim_bench.cli.bench import app as bench
    from anysim_bench.cli.record import record

    bench.command("record")(record)
    app.add_typer(bench, name="bench")
