"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl
def add_cli(app: "typer.Typer") -> None:
    """`anysim run`, `anysim report` and `anysim counterfactual`."""
    from anysim_collect import cli, pairs_cli

    app.command("run")(cli.run)
    app.command("report")(cli.report)
    app.command("counterfactual")(pairs_cli.counterfactual)
