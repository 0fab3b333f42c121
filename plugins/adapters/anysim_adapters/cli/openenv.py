"""`anysim openenv`: a task for clients of OpenEnv."""

from pathlib import Path
from typing import Annotated

import typer

from anysim.cli.options import Engine, Overrides
from anysim_serving.cli.listening import run, settings_of

PORT = 8472


def openenv(
    task: Annotated[str, typer.Argument(metavar="TASK|FILE", help="An installed task or a YAML file.")],
    engine: Engine = None,
    override: Overrides = None,
    host: Annotated[str, typer.Option(help="The address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="The port; 0 is any that is free.")] = PORT,
    no_token: Annotated[
        bool, typer.Option("--no-token", help="Let every process of this machine in; on loopback only.")
    ] = False,
    tls_certificate: Annotated[Path | None, typer.Option(help="A PEM file: serve https with it.")] = None,
    tls_key: Annotated[Path | None, typer.Option(help="Its key, where that is in a file of its own.")] = None,
    max_sessions: Annotated[int, typer.Option(min=1, help="Clients at once; each has a simulator.")] = 16,
) -> None:
    """Serve a task to clients of OpenEnv: each connection is a session with one env.

    The token is printed once; a client sends it: GenericEnvClient(ADDRESS, headers={"Authorization": "Bearer TOKEN"}).
    ANYSIM_SERVE_TOKEN gives another one. SIGINT and SIGTERM end the service.

    Examples:
      anysim openenv reach
      anysim openenv pick_cube --engine sapien --no-token
    """
    from anysim_adapters.openenv.server import openenv_service
    from anysim_serving.settings import Limits

    settings = settings_of(host, port, no_token, tls_certificate, tls_key, Limits(sessions=max_sessions))
    service = openenv_service(task, settings, engine=engine, overrides=tuple(override or ()))

    run(service, f"serving {task} to clients of OpenEnv at {service.address}")
