"""Listening: the settings of the commands of services, and what they say while they run."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from anysim_serving.server import Service
    from anysim_serving.settings import Limits, Settings


def settings_of(
    host: str,
    port: int,
    no_token: bool,
    certificate: Path | None,
    key: Path | None,
    limits: "Limits",
    hosts: Sequence[str] | None = None,
    origins: Sequence[str] | None = None,
) -> "Settings":
    """Where a service listens and whom it answers, with the token of ANYSIM_SERVE_TOKEN, or a fresh one."""
    from anysim_client.token import TOKEN_ENV
    from anysim_serving.server import fresh_token
    from anysim_serving.settings import Settings

    token = "" if no_token else os.environ.get(TOKEN_ENV) or fresh_token()
    return Settings(host, port, token, tuple(hosts or ()), tuple(origins or ()), certificate, key, limits)


def run(service: "Service", what: str, use: str = "", *, keep: bool = False) -> None:
    """Run a service until SIGINT or SIGTERM; what it is, its token and how to use it are told once it answers.

    With `keep` the token is meanwhile kept for the user's own clients.
    """
    from anysim_client.token import TOKEN_ENV, forget_token, keep_token

    settings = service.settings
    kept = keep_token(service.address, settings.token) if keep and settings.token else None

    def told() -> None:
        typer.echo(what)
        if not settings.token:
            typer.echo(
                "warning: there is no token: every process and user of this machine can use the service", err=True
            )
        else:
            typer.echo(f"token: {'that of ' + TOKEN_ENV if os.environ.get(TOKEN_ENV) else settings.token}")
        if kept is not None:
            typer.echo(f"kept for your own clients on this machine in {kept}")
        if not settings.on_loopback and settings.certificate is None:
            typer.echo("warning: without TLS the token and all data can be read on the network between", err=True)
        if use:
            typer.echo(use)

    try:
        service.run(told)
    finally:
        if kept is not None:
            forget_token(kept, settings.token)
    typer.echo("ended: all envs are freed")
