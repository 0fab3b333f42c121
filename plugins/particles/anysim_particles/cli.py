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
    kinds: Annotated[str, typer.Option(help="Families, separated by commas; all of them if not given.")] = "",
    steps: Annotated[int, typer.Option(min=1, help="Control steps of five physics steps that are measured.")] = 10,
    json: AsJson = False,
) -> None:
    """Physics steps of one env per second of processor time, of a world with one family.

    Particles are at rest in a tank, with a box on top; the others have a size of their own, and a ball that they meet.
    The rest of the step is what the same world costs without the family, stepped five at a time, and one at a time as
    it is beside a co-solver. Wall time is that of all envs together, shared by threads.

    Examples:
      anysim bench families --engine mujoco,pybullet,sapien --particles 1000
    """
    from anysim_particles.bench import EDGES, cost
    from anysim_particles.bench_cases import FAMILIES, OBJECTS

    known = [*OBJECTS, *EDGES, *FAMILIES]
    sizes = numbers(particles, "--particles", int, 1)
    found = [
        cost(kind, size, envs, name, steps)
        for name in parts(engine, "--engine")
        for kind in parts(kinds or ",".join(known), "--kinds", known)
        for size in (sizes if kind in EDGES else sizes[:1])
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
    heads = (*heads, "solver alone") if any(one.solver for one in found) else heads
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
                *([f"{one.solver:,.0f}"] if one.solver else []),
            )
            for one in found
        ],
    )
