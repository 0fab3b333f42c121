"""`anysim bench stopping`."""

from typing import Annotated

import typer

from anysim.cli.options import AsJson, numbers, parts


def stopping(
    engines: Annotated[str, typer.Option("--engines", "-e", help="Installed engines, by commas.")] = "mujoco",
    speeds: Annotated[str, typer.Option(help="Speeds [m/s], by commas.")] = "0.3,0.6,0.9",
    latencies: Annotated[str, typer.Option(help="Latencies of the guard [s], by commas.")] = "0.0,0.2",
    robots: Annotated[str, typer.Option(help="mobile_panda, differential_base, by commas.")] = "mobile_panda",
    json: AsJson = False,
) -> None:
    """Stop bases for somebody who is in their way all at once, and hold the distance against the formula.

    Examples:
      anysim bench stopping --engines mujoco,pybullet,sapien
    """
    from anysim.cli.output import counting, print_json, print_table
    from anysim_mobile.stopping import BASES, Stop, stop

    cases = [
        (robot, engine, speed, latency)
        for robot in parts(robots, "--robots", BASES)
        for engine in parts(engines, "--engines")
        for latency in numbers(latencies, "--latencies", float, 0.0)
        for speed in numbers(speeds, "--speeds", float, 0.05)
    ]
    found: list[Stop] = []
    with counting("stops", len(cases), quiet=json) as show:
        for case in cases:
            found.append(stop(*case))
            show(f"{case[0]} on {case[1]}: {found[-1].distance:.3f} m", "")
    if json:
        print_json([one._asdict() for one in found])
        return
    columns = ("robot", "engine", "speed [m/s]", "latency [s]", "went on [m]", "formula [m]", "more [m]", "left [m]")
    rows = [
        (
            one.robot,
            one.engine,
            f"{one.speed:.3f}",
            f"{one.latency:g}",
            f"{one.distance:.3f}",
            f"{one.formula:.3f}",
            f"{one.distance - one.formula:+.3f}",
            f"{one.left:.3f}",
        )
        for one in found
    ]
    print_table("Stopping distances", columns, rows)
