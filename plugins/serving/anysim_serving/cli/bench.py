"""`anysim bench serve`: what a service costs."""

from typing import Annotated

import typer

from anysim.cli.options import AsJson


def serve(
    seconds: Annotated[float, typer.Option(min=0.1, help="How long each row is measured.")] = 5.0,
    soak: Annotated[float, typer.Option(min=0.0, help="Seconds for which many clients step; 0 leaves that out.")] = 0.0,
    clients: Annotated[int, typer.Option(min=1, help="Clients of the soak, each with a session of its own.")] = 64,
    json: AsJson = False,
) -> None:
    """Measure exchanges with a service on loopback, beside those of a bare echo server in turn with them.

    The env stands still, so a row is the cost of the service and its client alone. An observation is of 64 envs with 50
    numbers each; images are those of 4 cameras, 12.6 MB. The echo server sends as many bytes with `websockets` alone,
    beside shared memory 64 bytes. With `--soak` many clients then step sessions of their own: fairness is Jain's index.

    Processor time is that of both sides together. A budget is the least that is good enough; a missed one is marked and
    changes nothing else. A machine that is busy with other things misses it: compare with the echo server.

    Examples:
      anysim bench serve
      anysim bench serve --soak 600
    """
    from anysim.cli.output import print_json, print_table
    from anysim_serving import bench

    found = []
    for cost in bench.costs(seconds):
        found.append(cost)
        typer.echo(f"measured: {cost.what}", err=True)
    run = bench.soak(clients, soak) if soak else None
    if json:
        print_json({"exchanges": [c._asdict() for c in found], "soak": None if run is None else run._asdict()})
        return
    heads = (
        "exchange",
        "MB",
        "ms (median)",
        "ms (fastest)",
        "MB/s",
        "processor ms",
        "echo ms (median)",
        "echo ms (fastest)",
        "echo processor ms",
        "budget",
    )
    rows = [
        (
            c.what,
            f"{c.megabytes:.3f}",
            f"{c.service.ms:.2f}",
            f"{c.service.fastest_ms:.2f}",
            f"{c.megabytes / c.service.ms * 1e3:,.0f}",
            f"{c.service.processor_ms:.2f}",
            f"{c.echo.ms:.2f}",
            f"{c.echo.fastest_ms:.2f}",
            f"{c.echo.processor_ms:.2f}",
            c.budget + " missed" * c.missed,
        )
        for c in found
    ]
    print_table("Exchanges with a service on loopback", heads, rows)
    if run is None:
        return
    order = sorted(run.steps)
    rate = sum(order) / run.seconds if run.seconds else 0.0
    typer.echo(
        f"soak: {run.clients} clients, {run.seconds:.0f} s, {sum(order):,} steps ({rate:,.0f}/s), "
        f"{len(run.errors)} errors"
    )
    typer.echo(
        f"  steps of a client: least {order[0]}, median {order[len(order) // 2]}, most {order[-1]}; "
        f"fairness {run.fairness:.3f}"
    )
    typer.echo(
        f"  memory of the service: {run.memory_mb:.1f} MB, at the end {run.memory_end_mb:.1f} MB, so it grew by "
        f"{run.memory_end_mb - run.memory_mb:+.1f} MB; left: "
        f"{run.sessions_left} sessions, {run.threads_left} threads"
    )
    for error in run.errors[:8]:
        typer.echo(f"  {error}")
    if run.errors:
        raise typer.Exit(1)
