"""`anysim bench soft`: what soft matter costs."""

from typing import Annotated

import typer

from anysim.cli.options import AsJson, numbers, parts


def soft(
    engine: Annotated[str, typer.Option("--engine", "-e", help="Engines, separated by commas.")] = "mujoco",
    num_envs: Annotated[str, typer.Option("--num-envs", "-n", help="Numbers of envs, separated by commas.")] = "1,4",
    cases: Annotated[str, typer.Option(help="What is measured, separated by commas; all of it if not given.")] = "",
    steps: Annotated[int, typer.Option(min=1, help="Control steps of five physics steps that are measured.")] = 10,
    json: AsJson = False,
) -> None:
    """Physics steps of one env per second of processor time, with soft matter on the ground and a ball on top of it.

    The columns are those of `anysim bench families`, and a last one: the steps of MuJoCo alone, with the same model and
    state, and neither the coupling to bodies nor an engine around it.

    Examples:
      anysim bench soft --engine mujoco,pybullet,sapien --num-envs 1
    """
    from anysim_particles.bench import cost_in
    from anysim_particles.cli import print_costs
    from anysim_soft.bench import MATTER, solver_of, world_of

    found = [
        cost_in(world_of(called), called, envs, name, steps, solver_of)
        for name in parts(engine, "--engine")
        for called in parts(cases or ",".join(MATTER), "--cases", MATTER)
        for envs in numbers(num_envs, "--num-envs", int, 1)
    ]
    print_costs(found, json=json)
