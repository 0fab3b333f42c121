"""The command line with the commands of this package, and `run`."""

import typer

from anysim_collect import commands as collect
from anysim_inspect.commands import add_cli

app = typer.Typer()
add_cli(app)
collect.add_cli(app)
