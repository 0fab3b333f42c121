"""Observers: pluggy hooks of the group `anysim`. They look at a run, they don't touch it.

A distribution registers a light module through an entry point of the group `anysim`; a function of it that is marked
with `hookimpl` takes only the arguments it wants.
"""

from functools import cache
from typing import TYPE_CHECKING, Any

import pluggy

if TYPE_CHECKING:
    from anysim.conventions import Array
    from anysim.task.contract import StepResult
    from anysim.task.env import TaskEnv

PROJECT = "anysim"
hookspec = pluggy.HookspecMarker(PROJECT)
hookimpl = pluggy.HookimplMarker(PROJECT)


class Specs:
    """The hooks that exist."""

    @hookspec
    def after_build(self, env: "TaskEnv") -> None:
        """The env is built and has not been reset yet."""

    @hookspec
    def before_episode(self, env: "TaskEnv", env_ids: "Array") -> None:
        """These envs were reset; their first observation is made."""

    @hookspec
    def after_step(self, env: "TaskEnv", result: "StepResult") -> None:
        """A control step is complete."""

    @hookspec
    def after_episode(self, env: "TaskEnv", env_ids: "Array") -> None:
        """These envs have just ended."""

    @hookspec
    def on_fault(self, env: "TaskEnv", env_ids: "Array") -> None:
        """The engine gave up on these envs in this step."""

    @hookspec
    def on_close(self, env: "TaskEnv") -> None:
        """The env is about to be destroyed."""

    @hookspec
    def add_cli(self, app: Any) -> None:
        """Add commands to the command line's typer application."""


@cache
def manager() -> pluggy.PluginManager:
    """The observers of this process; those of installed distributions are found on first use."""
    plugins = pluggy.PluginManager(PROJECT)
    plugins.add_hookspecs(Specs)
    plugins.load_setuptools_entrypoints(PROJECT)
    return plugins


def stepped(env: "TaskEnv", result: "StepResult", env_ids: "Array | None") -> None:
    """Call the observers of a control step of these envs (None: of all); without observers nothing is worked out."""
    hook = manager().hook
    if hook.after_step.get_hookimpls():
        hook.after_step(env=env, result=result)
    for call, happened in ((hook.on_fault, lambda: result.info["fault"]), (hook.after_episode, lambda: result.done)):
        if call.get_hookimpls():
            concerned = happened().nonzero()[0] if env_ids is None else env_ids[happened()[env_ids]]
            if len(concerned):
                call(env=env, env_ids=concerned)
