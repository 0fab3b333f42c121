"""`anysim bench record`: the share of recording in collecting, without cameras and with them, in one run."""

from typing import Annotated

import typer

from anysim.cli.options import AsJson

SHARE_GOAL = 0.10
"""Of the wall time of a collection, for recording on the thread that steps, without cameras."""


def record(
    engine: Annotated[str | None, typer.Option("--engine", "-e", help="default: ANYSIM_ENGINE, else mujoco.")] = None,
    num_envs: Annotated[int, typer.Option("--num-envs", "-n", min=1, help="Envs.")] = 16,
    episodes: Annotated[int, typer.Option("--episodes", "-k", min=1, help="Episodes, over all envs.")] = 64,
    task: Annotated[str, typer.Option(help="The task, which has an expert and cameras.")] = "pick_cube",
    rounds: Annotated[int, typer.Option(min=1, help="Collections; the one with the median share counts.")] = 3,
    json: AsJson = False,
) -> None:
    """Collect the same episodes without cameras and with the task's, and see what recording takes where.

    `recording` is wall time of the thread that steps: columns, hand-over, and waiting while too much is queued.
    `drawing` is that thread's too, in the engine. `recorder's thread` is its processor time: encoding, writing, fsync.

    Examples:
      anysim bench record -n 16
    """
    from anysim.cli.output import print_json
    from anysim.engine.factory import default_engine
    from anysim_bench.collect import CollectCost, collect_costs, typical
    from anysim_bench.rows import Rows
    from anysim_recording.committer import QUEUE_BYTES

    title = (
        f"Recording {task}, as shares of wall time; at most {SHARE_GOAL:.0%} without cameras, and {QUEUE_BYTES >> 20} "
        "MiB wait for the recorder's thread"
    )
    rows = Rows(title, ("cameras", "envs", "steps/s", "recording", "drawing", "recorder's thread"), (7,), quiet=json)
    costs: list[CollectCost] = []
    for cameras in (False, True):
        typer.echo(f"collecting {episodes} episodes in {num_envs} envs…", err=True)
        c = typical(collect_costs(engine or default_engine(), num_envs, episodes, 0, task, cameras, rounds))
        costs.append(c)
        wall = c.steps / c.steps_per_s
        shares = (c.where["record"], c.where["draw"], c.record_s)
        rows.add(c.cameras, c.num_envs, f"{c.steps_per_s:,.0f}", *(f"{seconds / wall:.1%}" for seconds in shares))
    if json:
        print_json([cost._asdict() for cost in costs])
