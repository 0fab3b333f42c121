"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl
def add_cli(app: "typer.Typer") -> None:
    """`anysim explain`, `doctor`, `audit` and `snapshot`."""
    from anysim_inspect.cli import audit, doctor, explain, snapshot

    app.command("explain")(explain.explain)
    app.command("doctor")(doctor.doctor)
    app.command("audit")(audit.audit)
    app.add_typer(snapshot.app, name="snapshot")
