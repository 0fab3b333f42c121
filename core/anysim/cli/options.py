"""Options that several commands share, and their help as it is written: whole summaries, examples with their lines."""

import os
import sys
from collections.abc import Collection, Sequence
from json import dumps
from math import inf
from typing import Annotated, Any, TypeVar

import typer
from typer.core import TyperGroup

from anysim.errors import PluginError, TaskError, listing, suggest
from anysim.registry import INSTALL_HINTS

N = TypeVar("N", int, float)

Task = Annotated[str, typer.Argument(metavar="TASK", help="An installed task (`anysim list tasks`) or a YAML file.")]
Engine = Annotated[
    str | None,
    typer.Option("--engine", "-e", help="An installed engine. Default: the file's, else ANYSIM_ENGINE, else mujoco."),
]
NumEnvs = Annotated[
    int | None, typer.Option("--num-envs", "-n", min=1, help="Parallel environments. Default: the file's, else 1.")
]
Seed = Annotated[
    int | None,
    typer.Option(
        "--seed", "-s", min=0, help="The seed that everything random follows from. Default: the file's, else 0."
    ),
]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "-o", "--override", metavar="KEY=VALUE", help="Override a value: `-o physics.dt=0.004`. May be repeated."
    ),
]
Robot = Annotated[
    str | None,
    typer.Option(help="A robot in the place of the task's own: one of its alternates, or another of the catalogue."),
]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Say what is approximate, with each measured error.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document for machines.")]


def with_robot(overrides: list[str] | None, robot: str | None) -> list[str]:
    """The overrides of a command, and the robot that it names."""
    return [*(overrides or ()), *([] if robot is None else [f"robot={dumps(robot)}"])]


def option_values(pairs: Sequence[str] | None, example: str) -> dict[str, Any]:
    """The values of `--option KEY=VALUE` by key, as YAML reads them.

    Raises:
        TaskError: one is of another form, cannot be read, or has a key that another has.
    """
    from anysim_schemas.nodes import Fault
    from anysim_schemas.yaml import parse

    values: dict[str, Any] = {}
    for pair in pairs or ():
        key, equals, value = pair.partition("=")
        if not equals or not key.isidentifier() or key in values:
            raise TaskError(f"--option {pair}: expected KEY=VALUE, each key once, as in --option {example}")
        faults: list[Fault] = []
        node = parse(value, f"--option {pair}", faults)
        if node is None or faults:
            raise TaskError(f"--option {pair}: the value cannot be read: {faults[0].message}")
        values[key] = node.plain()
    return values


def parts(text: str, option: str, among: Collection[str] = ()) -> list[str]:
    """The words of an option's value, which commas separate.

    Raises:
        TaskError: there is none, or one that is not `among` those that there are.
    """
    found = [part.strip() for part in text.split(",") if part.strip()]
    for part in found or [text]:
        if not found or (among and part not in among):
            near = suggest(part, list(among))
            known = f"{near} (there are: {listing(among)})" if among else "; expected words, separated by commas"
            raise TaskError(f"{option}: there is no '{part}'{known}")
    return found


def numbers(text: str, option: str, kind: type[N], least: float) -> list[N]:
    """The numbers of an option's value, which commas separate.

    Raises:
        TaskError: there is none, or one that is no number of at least `least`.
    """
    try:
        found = [kind(part) for part in parts(text, option)]
    except ValueError:
        found = []
    if not found or not all(least <= number < inf for number in found):
        what = "whole numbers" if kind is int else "numbers"
        raise TaskError(f"{option} {text}: expected {what} of at least {least:g}, separated by commas")
    return found


UNWRAPPED = "\b\n"
"""What a paragraph of help begins with to keep its lines."""


BROKE = 3
"""The exit code where something broke, that is neither an answer nor a fault of the input."""


class CommandEnded(Exception):
    """A command was ended from within, by what is its cause."""


class Commands(TyperGroup):
    """A group whose list shows the first paragraph of each command; a paragraph with indented lines is not wrapped."""

    def invoke(self, ctx: typer.Context) -> object:
        """Run the command. What ends a program without an error in Python is the reader's leave, or a crash here."""
        try:
            return super().invoke(ctx)
        except BrokenPipeError:  # as of `| head`: nothing is wrong, and nothing more can be said
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise typer.Exit(0) from None
        except (SystemExit, EOFError) as error:  # raised by a plugin: typer takes them for the end of the command
            raise CommandEnded(str(error)) from error

    def resolve_command(self, ctx: typer.Context, args: list[str]):  # noqa: ANN201
        """The command that is named; one of a package that is not installed is an error that names the package."""
        package = INSTALL_HINTS.get(("commands", args[0]))
        if package is not None and self.get_command(ctx, args[0]) is None:
            raise PluginError(f"`anysim {args[0]}` comes with {package}, which is not installed: pip install {package}")
        return super().resolve_command(ctx, args)

    def get_command(self, ctx: typer.Context, cmd_name: str):  # noqa: ANN201 - typer moves the class of commands
        """The command of a name, or None; those inside it are prepared too."""
        found = super().get_command(ctx, cmd_name)
        for command in [found, *getattr(found, "commands", {}).values()]:
            _prepare(command)
        return found


def _prepare(command: Any) -> None:
    if command is None or not command.help or command.help.startswith(UNWRAPPED):
        return
    first, *others = command.help.split("\n\n")
    command.short_help = " ".join(first.split())
    command.help = "\n\n".join([first, *(f"{UNWRAPPED}{p}" if _indented(p) else p for p in others)])


def _indented(paragraph: str) -> bool:
    return "\n " in paragraph and not paragraph.startswith(UNWRAPPED)
