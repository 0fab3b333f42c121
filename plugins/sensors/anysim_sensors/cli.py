"""`anysim bench sensors`: what readings cost."""

from typing import Annotated

import typer

from anysim.cli.options import AsJson


def sensors(
    geoms: Annotated[
        int, typer.Option("--geoms", "-g", min=5, help="Shapes of the scene, a fifth of them hulls.")
    ] = 50,
    rounds: Annotated[int, typer.Option(min=1, help="Rounds; the best of each counts.")] = 30,
    json: AsJson = False,
) -> None:
    """What readings of sensors cost in processor time of one core: by themselves, and in a control step of 16 envs.

    A goal is what is good enough; one that is missed is marked and changes nothing else. The first run of a machine
    compiles the kernels, which takes half a minute.

    Examples:
      anysim bench sensors --geoms 200
    """
    from anysim.cli.output import print_json, print_table
    from anysim_sensors.bench import sensor_costs
    from anysim_sensors.step_bench import step_costs

    costs = sensor_costs(geoms, rounds) + step_costs(min(rounds, 5))
    if json:
        print_json([cost._asdict() | {"missed": cost.missed} for cost in costs])
        return
    print_table(
        f"Readings in a scene of {geoms} shapes, of one core",
        ("what", "is", "unit", "goal"),
        [(c.what, f"{c.value:.3g}", c.unit, c.words) for c in costs],
    )
