"""`anysim openpi`: a policy for clients of openpi."""

from pathlib import Path
from typing import Annotated

import typer

from anysim.cli.options import Engine, Overrides
from anysim_serving.cli.listening import run, settings_of

PORT = 8000


def openpi(
    task: Annotated[
        str, typer.Argument(metavar="TASK|FILE", help="The task whose observations and actions the policy has.")
    ],
    policy: Annotated[
        str, typer.Option("--policy", "-p", help="As `anysim evaluate --policy`: shipped, FILE.onnx, …")
    ] = "shipped",
    keys: Annotated[
        str, typer.Option(metavar="THEIRS:OURS+…", help="Clients' names of observations. [default: the task's]")
    ] = "",
    engine: Engine = None,
    override: Overrides = None,
    host: Annotated[str, typer.Option(help="The address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="The port; 0 is any that is free.")] = PORT,
    no_token: Annotated[
        bool, typer.Option("--no-token", help="Let every process of this machine in; on loopback only.")
    ] = False,
    tls_certificate: Annotated[Path | None, typer.Option(help="A PEM file: serve wss with it.")] = None,
    tls_key: Annotated[Path | None, typer.Option(help="Its key, where that is in a file of its own.")] = None,
    max_clients: Annotated[int, typer.Option(min=1, help="Clients at once; they wait for one policy in turn.")] = 8,
) -> None:
    """Serve a policy to clients of openpi: an observation and a prompt in, a chunk of actions out.

    The token is printed once; a client sends it as its API key: WebsocketClientPolicy(host, port, api_key=TOKEN), and
    `anysim evaluate` that of ANYSIM_POLICY_KEY. ANYSIM_SERVE_TOKEN gives another one. SIGINT and SIGTERM end it.

    Examples:
      anysim openpi go1_velocity
      anysim openpi pick_cube --policy runs/bc/policy.onnx --keys observation/state:policy
    """
    from anysim_adapters.openpi.host import PolicyHost
    from anysim_adapters.openpi.server import policy_service
    from anysim_serving.settings import Limits

    settings = settings_of(host, port, no_token, tls_certificate, tls_key, Limits(sessions=max_clients))
    with PolicyHost(
        task, policy, clients=max_clients, engine=engine, overrides=tuple(override or ()), keys=keys
    ) as served:
        service = policy_service(served, settings)
        run(service, f"serving the policy {policy} of {task} to clients of openpi at {service.address}")
