"""`anysim bench touch`: what readings of taxels cost."""

from typing import Annotated

import typer

from anysim.cli.options import AsJson


def touch(
    rounds: Annotated[int, typer.Option(min=1, help="Rounds; the best of each counts.")] = 200, json: AsJson = False
) -> None:
    """What readings of taxels cost in processor time of one core, the engine's contacts left out.

    A goal is what is good enough; one that is missed is marked and changes nothing else. The first run of a machine
    compiles the kernels, which takes half a minute.

    Examples:
      anysim bench touch --rounds 50
    """
    from anysim.cli.output import print_json, print_table
    from anysim_tactile.bench import touch_costs

    costs = touch_costs(rounds)
    if json:
        print_json([cost._asdict() | {"missed": cost.missed} for cost in costs])
        return
    rows = [(c.what, f"{c.value:.3g}", c.unit, c.words) for c in costs]
    print_table("Readings of taxels, of one core", ("what", "is", "unit", "goal"), rows)
