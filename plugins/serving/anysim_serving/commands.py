"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl
def add_cli(app: "typer.Typer") -> None:
    """`anysim serve`, and `anysim bench serve` where `anysim bench` is installed."""
    from anysim_serving.cli import bench, serve

    app.command("serve")(serve.serve)
    # the group of anysim-bench is there before: plugins join in the order of their names
    for group in app.registered_groups:
        if group.name == "bench" and group.typer_instance is not None:
            group.typer_instance.command("serve")(bench.serve)
