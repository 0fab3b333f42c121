"""`anysim bench legged`: what a legged env costs on top of an engine."""

from typing import Annotated

import typer

from anysim.cli.options import AsJson


def legged(
    engines: Annotated[str, typer.Option("--engines", "-e", help="Engines with commas, or all that can run here.")] = (
        "all"
    ),
    num_envs: Annotated[
        int | None,
        typer.Option(
            "--num-envs", "-n", min=1, help="Envs; 256, or 16 where an engine has a world for each, if unsaid."
        ),
    ] = None,
    rounds: Annotated[int, typer.Option(min=1, help="Rounds; the best of each counts.")] = 10,
    robot: Annotated[str, typer.Option(help="A quadruped of the catalogue.")] = "unitree_go1",
    json: AsJson = False,
) -> None:
    """An env with observations, rewards and resets, beside the engine's own loop without any, in one run.

    A goal is what is good enough; one that is missed is marked and changes nothing else. Ratios of wall time need an
    idle machine; those of processor time bear some load.

    Examples:
      anysim bench legged --engines mujoco
    """
    from anysim.cli.output import print_json, print_table
    from anysim.engine.base import SimEngine
    from anysim.engine.factory import engine_class, runnable
    from anysim_legged_gym.bench import GOAL, legged_cost

    known = [name for name in runnable() if engine_class(name).raw_loop is not SimEngine.raw_loop]
    chosen = known if engines == "all" else [name.strip() for name in engines.split(",")]
    costs = [legged_cost(engine, num_envs, rounds, robot) for engine in chosen]
    if json:
        print_json([cost._asdict() | {"missed": cost.missed} for cost in costs])
        return
    print_table(
        f"Control steps of {robot}, 20 ms each, of all envs together per second",
        ("engine", "envs", "own loop", "simulator", "env", "ratio", "of cpu", "goal", "heights us", "level us"),
        [
            (
                c.engine,
                str(c.num_envs),
                f"{c.raw:.0f}",
                f"{c.simulator:.0f}",
                f"{c.env:.0f}",
                f"{c.ratio:.2f}",
                f"{c.cpu_ratio:.2f}",
                f"{GOAL[c.engine]:g}" + " missed" * c.missed if c.engine in GOAL else "",
                f"{c.heights:.1f}",
                f"{c.level:.1f}",
            )
            for c in costs
        ],
    )
