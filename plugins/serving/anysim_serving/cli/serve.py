"""`anysim serve`: envs of tasks and worlds for other processes and machines."""

from pathlib import Path
from typing import Annotated

import typer

from anysim.cli.options import Engine, NumEnvs, Overrides
from anysim_serving.cli.listening import run, settings_of

PORT = 8470


def serve(
    sources: Annotated[
        list[str],
        typer.Argument(metavar="TASK|WORLD…", help="Installed tasks or YAML files; the first is the default."),
    ],
    num_envs: NumEnvs = None,
    engine: Engine = None,
    override: Overrides = None,
    all_tasks: Annotated[bool, typer.Option("--all-tasks", help="Let clients have every installed task.")] = False,
    host: Annotated[str, typer.Option(help="The address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="The port; 0 is any that is free.")] = PORT,
    no_token: Annotated[
        bool, typer.Option("--no-token", help="Let every process of this machine in; on loopback only.")
    ] = False,
    allow_host: Annotated[
        list[str] | None, typer.Option(help="Another name under which it may be asked. May be repeated.")
    ] = None,
    allow_origin: Annotated[
        list[str] | None, typer.Option(help="The origin of a web page that may ask. May be repeated.")
    ] = None,
    tls_certificate: Annotated[Path | None, typer.Option(help="A PEM file: serve https with it.")] = None,
    tls_key: Annotated[Path | None, typer.Option(help="Its key, where that is in a file of its own.")] = None,
    max_sessions: Annotated[int, typer.Option(min=1, help="Sessions at once; each has a simulator.")] = 16,
    max_envs: Annotated[int, typer.Option(min=1, help="Envs of one session.")] = 256,
    max_total_envs: Annotated[int, typer.Option(min=1, help="Envs of all sessions together.")] = 1024,
    idle: Annotated[float, typer.Option(min=1.0, help="Seconds after which an unused session is ended.")] = 600.0,
    linger: Annotated[float, typer.Option(min=0.0, help="The same where its client's connection is gone.")] = 30.0,
) -> None:
    """Serve envs over HTTP and WebSocket; `anysim.connect(ADDRESS)` gives the env that `anysim.make` would.

    Each client gets a session with a simulator of its own. Everyone with the token may use the service. It is printed
    once, and kept for your own clients on this machine in a file that only you can read. ANYSIM_SERVE_TOKEN gives
    another one. SIGINT and SIGTERM end it: operations at hand finish, envs are freed.

    Examples:
      anysim serve pick_cube --num-envs 16
      anysim serve pick_cube reach warehouse.yaml --engine pybullet --port 0
      anysim serve pick_cube --host 0.0.0.0 --tls-certificate cert.pem --tls-key key.pem --allow-host sim.lab
    """
    import logging

    from anysim_serving.catalogue import Catalogue
    from anysim_serving.server import Service
    from anysim_serving.settings import Limits

    logging.basicConfig(format="%(levelname)s %(name)s: %(message)s", level=logging.WARNING)
    limits = Limits(
        sessions=max_sessions, envs=max_envs, total_envs=max_total_envs, idle_s=idle, linger_s=min(linger, idle)
    )
    settings = settings_of(host, port, no_token, tls_certificate, tls_key, limits, allow_host, allow_origin)
    catalogue = Catalogue.of(
        sources, all_tasks=all_tasks, num_envs=num_envs, engine=engine, overrides=tuple(override or ()), limits=limits
    )
    service = Service(catalogue, settings)
    use = f'use it: env = anysim.connect("{service.address}"); Ctrl-C ends it'
    run(service, f"serving {', '.join(catalogue.names())} at {service.address}", use, keep=True)
