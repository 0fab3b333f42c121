"""Observers: pluggy hooks of the group `anysim`. They look at a run, they don't touch it.

A distribution registers a light module through an entry point of the group `anysim`; a function of it that is marked
with `hookimpl` takes only the arguments it wants. A module that fails is left out with a warning that names its
distribution: what only looks on must not stop a run, and less so the command that would say how to repair it.
"""

import warnings
from functools import cache
from typing import TYPE_CHECKING

import pluggy

from anysim import registry

if TYPE_CHECKING:
    import typer

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
    def add_cli(self, app: "typer.Typer") -> None:
        """Add commands to the command line's typer application."""


@cache
def manager() -> pluggy.PluginManager:
    """The observers of this process; those of installed distributions are found on first use, in order of name."""
    plugins = pluggy.PluginManager(PROJECT)
    plugins.add_hookspecs(Specs)
    found = {f"{entry.dist.name if entry.dist else 'unknown'}:{entry.name}": entry for entry in registry.observers()}
    for name in sorted(found):
        try:
            plugins.register(found[name].load(), name)
        except (Exception, SystemExit) as error:  # noqa: BLE001 - whatever a plugin does, the others go on
            _left_out(name, f"does not load: {type(error).__name__}: {error}")
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


def add_commands(app: "typer.Typer") -> None:
    """Add the commands of all observers to the command line; one that fails costs its own commands alone."""
    plugins = manager()
    for name, plugin in plugins.list_name_plugin():
        others = [other for other in plugins.get_plugins() if other is not plugin]
        try:
            plugins.subset_hook_caller("add_cli", others)(app=app)
        except (Exception, SystemExit) as error:  # noqa: BLE001 - whatever a plugin does, the others go on
            _left_out(name, f"adds no commands: {type(error).__name__}: {error}")


def _left_out(name: str, what: str) -> None:
    """Warn of an observer, `distribution:entry point`, and say how to be rid of it."""
    distribution, _, entry = name.partition(":")
    remedy = f"repair the package {distribution}, or remove it: pip uninstall {distribution}"
    warnings.warn(f"the plugin '{entry}' of {distribution} {what}; {remedy}", RuntimeWarning, stacklevel=3)
