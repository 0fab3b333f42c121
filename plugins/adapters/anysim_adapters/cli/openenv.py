"""`anysim openenv`: a task for clients of OpenEnv."""

import os
from pathlib import Path
from typing import Annotated

import typer

from anysim.cli.options import Engine, Overrides

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
    from anysim_client.token import TOKEN_ENV
    from anysim_serving.server import fresh_token
    from anysim_serving.settings import Limits, Settings

    given = os.environ.get(TOKEN_ENV)
    token = "" if no_token else given or fresh_token()
    settings = Settings(host, port, token, (), (), tls_certificate, tls_key, Limits(sessions=max_sessions))
    service = openenv_service(task, settings, engine=engine, overrides=tuple(override or ()))

    def told() -> None:
        typer.echo(f"serving {task} to clients of OpenEnv at {service.address}")
        if not token:
            typer.echo(
                "warning: there is no token: every process and user of this machine can use the service", err=True
            )
        else:
            typer.echo(f"token: {'that of ' + TOKEN_ENV if given else token}")
        if not settings.on_loopback and tls_certificate is None:
            typer.echo("warning: without TLS the token and all data can be read on the network between", err=True)

    service.run(told)
    typer.echo("ended: all envs are freed")
