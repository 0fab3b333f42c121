"""`anysim bench families`: what matter costs."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from anysim.cli.options import AsJson, numbers, parts

if TYPE_CHECKING:
    from anysim_particles.bench import FamilyCost


def families(
    engine: Annotated[str, typer.Option("--engine", "-e", help="Engines, separated by commas.")] = "mujoco",
    particles: Annotated[str, typer.Option(help="Particles of each env, separated by commas.")] = "1000,5000",
    num_envs: Annotated[str, typer.Option("--num-envs", "-n", help="Numbers of envs, separated by commas.")] = "1,4",
    kinds: Annotated[str, typer.Option(help="Families, separated by commas.")] = "fluid,sand,rice",
    steps: Annotated[int, typer.Option(min=1, help="Control steps of five physics steps that are measured.")] = 10,
    json: AsJson = False,
) -> None:
    """Physics steps of one env per second of processor time, with matter at rest in a tank beside a box that floats.

    The rest of the step is what the same world costs without the matter, stepped five at a time, and one at a time as
    it is beside a co-solver. Wall time is that of all envs together, shared by threads.

    Examples:
      anysim bench families --engine mujoco,pybullet,sapien --particles 1000
    """
    from anysim_particles.bench import EDGES, cost

    found = [
        cost(kind, size, envs, name, steps)
        for name in parts(engine, "--engine")
        for kind in parts(kinds, "--kinds", EDGES)
        for size in numbers(particles, "--particles", int, 1)
        for envs in numbers(num_envs, "--num-envs", int, 1)
    ]
    print_costs(found, json=json)


def print_costs(found: "Sequence[FamilyCost]", *, json: bool) -> None:
    """Print them as a table, or as JSON."""
    from anysim.cli.output import print_json, print_table

    if json:
        print_json([one._asdict() for one in found])
        return
    heads = ("engine", "family", "points", "envs", "steps/s (cpu)", "steps/s (wall)", "alone", "alone, one by one")
    print_table(
        "Physics steps per second, of one env",
        heads,
        [
            (
                one.engine,
                one.family,
                f"{one.particles:,}",
                str(one.num_envs),
                f"{one.per_second:,.0f}",
                f"{one.wall_per_second:,.0f}",
                f"{one.alone:,.0f}",
                f"{one.one_by_one:,.0f}",
            )
            for one in found
        ],
    )
