"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl
def add_cli(app: "typer.Typer") -> None:
    """`anysim run`, `anysim report` and `anysim counterfactual`."""
    from anysim_collect.cli import counterfactual, run

    app.command("run")(run.run)
    app.command("report")(run.report)
    app.command("counterfactual")(counterfactual.counterfactual)
