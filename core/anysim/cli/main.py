"""`anysim`: the application, its commands, and what errors look like."""

import sys
import warnings

import typer

from anysim import __version__
from anysim.cli import audit, check, doctor, explain, listing, replay, run, schema, snapshot
from anysim.cli.options import Commands

EXIT_CODES = """Exit codes: 0 done; 1 it ran, and the answer is no (a replay that differs, a file with faults, too few
successes); 2 bad input; 130 interrupted."""

app = typer.Typer(
    name="anysim",
    cls=Commands,
    help="One YAML world and one MDP on any physics engine.",
    epilog=EXIT_CODES,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # plain help: importing what draws boxes takes as long as everything else together
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("run")(run.run)
app.command("replay")(replay.replay)
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


def _join_commands() -> None:
    """The commands of plugins; what is wrong with one is a sentence on stderr."""
    from anysim import hooks

    with warnings.catch_warnings(record=True) as faults:
        warnings.simplefilter("always", RuntimeWarning)
        hooks.add_commands(app)
    for fault in faults:
        typer.echo(f"warning: {fault.message}", err=True)


def main() -> None:
    """Run the command line; errors of anysim become sentences on stderr and exit code 2."""
    from anysim_schemas.errors import AnysimError

    if sys.argv[1:2] != ["--version"]:
        _join_commands()
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
