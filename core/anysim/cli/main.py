"""`anysim`: the application, its commands, and what errors look like."""

import sys
import traceback
import warnings
from typing import Any

import typer

from anysim import __version__
from anysim.cli import schema
from anysim.cli.options import BROKE, CommandEnded, Commands

EXIT_CODES = """Exit codes: 0 done; 1 it ran, and the answer is no (a replay that differs, a file with faults, too few
successes); 2 it could not be done as asked (usage, a file, a missing package); 3 something broke: a plugin, an engine
or anysim itself; 130 interrupted."""

app = typer.Typer(
    name="anysim",
    cls=Commands,
    help="One YAML world and one MDP on any physics engine.\n\n"
    "Begin with `anysim list tasks` and `anysim run pick_cube`; `anysim COMMAND --help` has examples.",
    epilog=EXIT_CODES,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # plain help: importing what draws boxes takes as long as everything else together
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("schema")(schema.schema)


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


def _sentences() -> None:
    """Have the warnings of anysim look like its errors: without the line of Python that gives them."""
    usual = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *where: Any) -> None:
        if category.__module__.partition(".")[0] == "anysim":
            typer.echo(f"warning: {message}", err=True)
        else:
            usual(message, category, *where)

    warnings.showwarning = show


def _broke(error: BaseException) -> None:
    """Tell of an error that no input explains: where it came from, and who is to know."""
    from anysim import registry

    error = error.__cause__ if isinstance(error, CommandEnded) and error.__cause__ else error
    typer.echo("".join(traceback.format_exception(error)), err=True, nl=False)
    package = registry.culprit(error) or "anysim"
    told = f"{registry.in_words(error)}: something broke in {package}; your input is not to blame"
    typer.echo(f"error: {told}. Report it with the lines above, or {registry.remedy(package)}", err=True)


def main() -> None:
    """Run the command line; errors of anysim become sentences on stderr. See `EXIT_CODES`."""
    from anysim.errors import FAILURES
    from anysim_schemas.errors import AnysimError

    try:
        _sentences()
        if sys.argv[1:2] != ["--version"]:
            _join_commands()
        app()
    except AnysimError as error:
        typer.echo(f"error: {error}", err=True)
        raise SystemExit(BROKE if isinstance(error, FAILURES) else 2) from None
    except Exception as error:  # noqa: BLE001 - a crash has a code of its own
        _broke(error)
        raise SystemExit(BROKE) from None
    except KeyboardInterrupt:
        typer.echo("interrupted", err=True)
        raise SystemExit(130) from None
