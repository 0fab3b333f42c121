"""The help of commands as it is written: summaries are printed whole, and examples keep their lines."""

from typing import Any

import typer
from typer.core import TyperGroup

UNWRAPPED = "\b\n"
"""What a paragraph of help begins with to keep its lines."""


class Commands(TyperGroup):
    """A group whose list shows the first paragraph of each command; a paragraph with indented lines is not wrapped."""

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
