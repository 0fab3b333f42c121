"""Commands that join the command line, and an observer that keeps points for the record."""

from typing import TYPE_CHECKING

from anysim.hooks import hookimpl, join_group

if TYPE_CHECKING:
    import typer

    from anysim.task.contract import StepResult
    from anysim.task.env import TaskEnv


@hookimpl
def after_step(env: "TaskEnv", result: "StepResult") -> None:
    """Points are kept for the record at their own rate."""
    if env.families is None:
        return
    from anysim_particles.stream import FOLLOWED

    stream = FOLLOWED.get(env)
    if stream is not None:
        stream.look(result.info["elapsed_steps"])


@hookimpl(trylast=True)
def add_cli(app: "typer.Typer") -> None:
    """`anysim bench families`, where anysim-bench has made the group."""
    from anysim_particles import cli

    join_group(app, "bench", families=cli.families)
