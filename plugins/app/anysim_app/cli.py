"""`anysim app`: the local page."""

from pathlib import Path
from typing import Annotated

import typer


def app(
    runs: Annotated[
        Path, typer.Option(help="The folder of runs, which are listed, and which new ones go into.")
    ] = Path("runs"),
    port: Annotated[int, typer.Option(min=0, max=65535, help="The port on 127.0.0.1; 0 is any that is free.")] = 8460,
    open_browser: Annotated[bool, typer.Option("--open", help="Open the page in a browser.")] = False,
) -> None:
    """Show a local page: engines, tasks, runs with videos and reports; start views, runs and comparisons in it.

    It listens on this machine alone. The address that is printed carries a token, which the browser keeps; who has it
    may start and stop what the page offers. Ctrl-C ends the page and what was started in it.

    Examples:
      anysim app --open
      anysim app --runs /data/runs --port 0
    """
    import webbrowser

    from anysim_app.page import serving_app

    service, url = serving_app(runs, port)

    def told() -> None:
        typer.echo(f"the page: {url}")
        typer.echo("Ctrl-C ends it, and what was started in it")
        if open_browser:
            webbrowser.open(url)

    service.run(told)
    typer.echo("ended")
