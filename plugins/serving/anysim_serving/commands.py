"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl, join_group

if TYPE_CHECKING:
    import typer


@hookimpl
def add_cli(app: "typer.Typer") -> None:
    """`anysim serve`, and `anysim bench serve` where `anysim bench` is installed."""
    from anysim_serving.cli import bench, serve

    app.command("serve")(serve.serve)
    join_group(app, "bench", serve=bench.serve)  # which is there before: plugins join in the order of their names
