"""`anysim mcp`: tools for agents, over the Model Context Protocol."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from anysim.cli.options import Engine, NumEnvs, Overrides

PORT = 8471


def mcp(
    sources: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="TASK|WORLD…", help="Installed tasks or YAML files, the first is the default; none: all tasks."
        ),
    ] = None,
    engine: Engine = None,
    num_envs: NumEnvs = None,
    override: Overrides = None,
    http: Annotated[bool, typer.Option("--http", help="Listen on a port, in place of stdin and stdout.")] = False,
    host: Annotated[str, typer.Option(help="With --http: the address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="With --http: the port; 0 is any that is free.")] = PORT,
    no_token: Annotated[
        bool, typer.Option("--no-token", help="With --http: let every process of this machine in; on loopback only.")
    ] = False,
    allow_host: Annotated[
        list[str] | None, typer.Option(help="Another name under which it may be asked. May be repeated.")
    ] = None,
    allow_origin: Annotated[
        list[str] | None, typer.Option(help="The origin of a web page that may ask. May be repeated.")
    ] = None,
    tls_certificate: Annotated[Path | None, typer.Option(help="A PEM file: serve https with it.")] = None,
    tls_key: Annotated[Path | None, typer.Option(help="Its key, where that is in a file of its own.")] = None,
    max_sessions: Annotated[int, typer.Option(min=1, help="Sessions at once; each has a simulator.")] = 4,
    max_envs: Annotated[int, typer.Option(min=1, help="Envs of one session.")] = 16,
    idle: Annotated[float, typer.Option(min=1.0, help="Seconds after which an unused session is ended.")] = 600.0,
    definitions: Annotated[
        Literal["mcp", "openai", "anthropic"] | None,
        typer.Option(help="Print the tools as JSON in this form, for other frameworks, and do nothing else."),
    ] = None,
) -> None:
    """Offer tools to an agent: observe, draw, command robots, write worlds, keep moments, ask what would have been.

    Without --http it speaks with the program that starts it, over stdin and stdout. With --http it listens on a port;
    the token is printed and kept as that of `anysim serve` (ANYSIM_SERVE_TOKEN gives another one), and clients send it
    as `Authorization: Bearer TOKEN`.

    Examples:
      anysim mcp put_away stack_cube
      anysim mcp --http --port 8471
      anysim mcp --definitions openai
    """
    from dataclasses import replace

    from anysim import registry

    if definitions is not None:
        from anysim.cli.output import print_json
        from anysim_agents.tools import definitions as defined

        print_json(defined(definitions))
        return

    from anysim_agents import mcp_server
    from anysim_agents.limits import SERVICE
    from anysim_serving.catalogue import Catalogue

    mcp_server.sdk()
    total = max(SERVICE.total_envs, max_envs)
    limits = replace(SERVICE, sessions=max_sessions, envs=max_envs, total_envs=total, idle_s=idle, linger_s=idle)
    catalogue = Catalogue.of(
        sources or registry.names("tasks")[:1],
        all_tasks=not sources,
        num_envs=num_envs,
        engine=engine,
        overrides=tuple(override or ()),
        limits=limits,
    )
    if not http:
        import asyncio

        from anysim_agents.workspace import Workspace

        asyncio.run(mcp_server.serve_stdio(Workspace(catalogue, shared=False)))
        return

    from anysim_serving.cli.listening import run, settings_of
    from anysim_serving.server import Service

    settings = settings_of(host, port, no_token, tls_certificate, tls_key, limits, allow_host, allow_origin)
    service = Service(catalogue, settings, mcp_server.http_application())
    address = f"{service.address}{mcp_server.HTTP_PATH}"
    run(
        service,
        f"tools for agents at {address}",
        "clients send `Authorization: Bearer TOKEN`; Ctrl-C ends it",
        keep=True,
    )
