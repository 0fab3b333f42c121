"""Listening: what the commands of servers share, their token and their words."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from anysim_serving.server import Service
    from anysim_serving.settings import Limits, Settings


def settings_of(
    host: str, port: int, no_token: bool, certificate: Path | None, key: Path | None, limits: "Limits"
) -> "Settings":
    """Where a server listens, with the token of ANYSIM_SERVE_TOKEN, or a fresh one."""
    from anysim_client.token import TOKEN_ENV
    from anysim_serving.server import fresh_token
    from anysim_serving.settings import Settings

    token = "" if no_token else os.environ.get(TOKEN_ENV) or fresh_token()
    return Settings(host, port, token, (), (), certificate, key, limits)


def run(service: "Service", what: str) -> None:
    """Serve until SIGINT or SIGTERM. The address and the token are printed once it answers."""
    from anysim_client.token import TOKEN_ENV

    settings = service.settings

    def told() -> None:
        typer.echo(f"{what} at {service.address}")
        if not settings.token:
            typer.echo(
                "warning: there is no token: every process and user of this machine can use the service", err=True
            )
        else:
            typer.echo(f"token: {'that of ' + TOKEN_ENV if os.environ.get(TOKEN_ENV) else settings.token}")
        if not settings.on_loopback and settings.certificate is None:
            typer.echo("warning: without TLS the token and all data can be read on the network between", err=True)

    service.run(told)
    typer.echo("ended: all envs are freed")
