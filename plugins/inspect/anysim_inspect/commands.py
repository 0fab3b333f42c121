"""Commands that join the command line."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl
def add_cli(app: "typer.Typer") -> None:
    """`anysim check`, `list`, `replay`, `verify`, `explain`, `doctor`, `audit` and `snapshot`."""
    from anysim_inspect.cli import audit, check, doctor, explain, list, replay, snapshot, verify

    app.command("check")(check.check)
    app.command("list")(list.list_)
    app.command("replay")(replay.replay)
    app.command("verify")(verify.verify)
    app.command("explain")(explain.explain)
    app.command("doctor")(doctor.doctor)
    app.command("audit")(audit.audit)
    app.add_typer(snapshot.app, name="snapshot")
