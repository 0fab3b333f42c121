"""`anysim`: the application, its commands, and what errors look like."""

import sys

import typer

from anysim import __version__
from anysim.cli import audit, check, doctor, explain, listing, render, replay, run, schema, snapshot

EXIT_CODES = """Exit codes: 0 done; 1 it ran, and the answer is no (a replay that differs, a file with faults, too few
successes); 2 bad input; 130 interrupted."""

app = typer.Typer(
    name="anysim",
    help="One YAML world and one MDP on any physics engine.",
    epilog=EXIT_CODES,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("run")(run.run)
app.command("replay")(replay.replay)
app.command("render")(render.render)
app.command("check")(check.check)
app.command("list")(listing.list_)
app.command("explain")(explain.explain)
app.command("doctor")(doctor.doctor)
app.command("audit")(audit.audit)
app.command("schema")(schema.schema)
app.add_typer(snapshot.app, name="snapshot")


def _version(show: bool) -> None:
    if show:
        typer.echo(f"anysim {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: bool = typer.Option(
        False, "--version", callback=_version, is_eager=True, help="Print the version and exit."
    ),
) -> None:
    pass


def main() -> None:
    """Run the command line; errors of anysim become sentences on stderr and exit code 2."""
    from anysim_schemas.errors import AnysimError

    if sys.argv[1:2] != ["--version"]:
        from anysim import hooks

        hooks.manager().hook.add_cli(app=app)
    try:
        app()
    except AnysimError as error:
        typer.echo(f"error: {error}", err=True)
        raise SystemExit(2) from None
    except BrokenPipeError:
        raise SystemExit(0) from None
    except KeyboardInterrupt:
        typer.echo("interrupted", err=True)
        raise SystemExit(130) from None
