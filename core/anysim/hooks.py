"""Observers: pluggy hooks of the group `anysim`. They look at a run, they don't touch it.

A distribution registers a light module through an entry point of the group `anysim`; a function of it that is marked
with `hookimpl` takes only the arguments it wants. A module that fails is left out with a warning that names its
distribution: what only looks on must not stop a run, and less so the command that would say how to repair it. What an
observer raises in a run is told once, counted, and costs the run nothing, unless the env is strict with observers.
"""

import warnings
from collections import Counter
from functools import cache
from typing import TYPE_CHECKING, Any

import pluggy

from anysim import registry
from anysim.errors import PluginFailure

if TYPE_CHECKING:
    from collections.abc import Callable

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


def join_group(app: "typer.Typer", group: str, **commands: "Callable[..., object]") -> None:
    """Add commands by name to a group of the command line, where the distribution that makes the group is installed."""
    for one in app.registered_groups:
        if one.name == group and one.typer_instance is not None:
            for name, command in commands.items():
                one.typer_instance.command(name)(command)


@cache
def manager() -> pluggy.PluginManager:
    """The observers of this process; those of installed distributions are found on first use, in order of name."""
    plugins = pluggy.PluginManager(PROJECT)
    plugins.add_hookspecs(Specs)
    found = {f"{entry.dist.name if entry.dist else 'unknown'}:{entry.name}": entry for entry in registry.observers()}
    for name in sorted(found):
        plugin = None
        try:
            plugin = found[name].load()
            plugins.register(plugin, name)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # noqa: BLE001 - whatever a plugin does, the others go on
            if plugin is not None and plugins.is_registered(plugin):
                plugins.unregister(plugin)  # some of its hooks may have been taken before the wrong one
            _left_out(name, f"does not load: {registry.in_words(error)}")
    return plugins


class ObserverWarning(RuntimeWarning):
    """An observer raised in a run, which goes on without what it would have seen."""


class Observing:
    """Calls the observers of one env. An observer that raises hurts neither the env nor the other observers.

    Attributes:
        strict: raise PluginFailure instead.
        failures: how often each has failed so far, by its words and the hook.
    """

    def __init__(self, strict: bool = False) -> None:
        self.strict = strict
        self.failures: Counter[tuple[str, str]] = Counter()

    def call(self, hook: str, **arguments: Any) -> None:
        """Call the observers of a hook, the one registered last first.

        Raises:
            PluginFailure: one has failed, and the env is strict.
        """
        for seen in reversed(getattr(manager().hook, hook).get_hookimpls()):
            try:
                if seen.hookwrapper or seen.wrapper:
                    raise TypeError("it wraps the other observers, and an observer only looks on")
                seen.function(*(arguments[name] for name in seen.argnames))
            except KeyboardInterrupt:
                raise
            except BaseException as error:  # noqa: BLE001 - it only looks on
                self._failed(_who(seen.plugin_name, seen.plugin), hook, error)

    def stepped(self, env: "TaskEnv", result: "StepResult", env_ids: "Array | None") -> None:
        """Call those of a control step of these envs (None: of all); without observers nothing is worked out."""
        hook = manager().hook
        if hook.after_step.get_hookimpls():
            self.call("after_step", env=env, result=result)
        for name, happened in (("on_fault", lambda: result.info["fault"]), ("after_episode", lambda: result.done)):
            if getattr(hook, name).get_hookimpls():
                concerned = happened().nonzero()[0] if env_ids is None else env_ids[happened()[env_ids]]
                if len(concerned):
                    self.call(name, env=env, env_ids=concerned)

    def closed(self) -> None:
        """Say how often observers have failed, where it was more than the once that was told."""
        for (who, hook), count in self.failures.items():
            if count > 1:
                warnings.warn(f"{who} failed in {hook} {count} times in this run", ObserverWarning, stacklevel=3)

    def _failed(self, who: tuple[str, str], hook: str, error: BaseException) -> None:
        named, package = who
        words = f"{named} failed in {hook}: {registry.in_words(error)}; {registry.remedy(package)}"
        if self.strict:
            raise PluginFailure(words) from error
        self.failures[named, hook] += 1
        if self.failures[named, hook] == 1:
            more = "The run goes on; further failures are counted. With strict_observers they end it"
            warnings.warn(f"{words}. {more}", ObserverWarning, stacklevel=4)


def _who(name: str, plugin: object) -> tuple[str, str]:
    """An observer in words, and its distribution; one that a program registers itself has no name but its type."""
    package, colon, entry = name.partition(":")
    if not colon:
        package, entry = registry.origin(plugin), type(plugin).__name__
    return f"the observer '{entry}' of {package}", package


def add_commands(app: "typer.Typer") -> None:
    """Add the commands of all observers to the command line; one that fails costs its own commands alone."""
    plugins = manager()
    for name, plugin in plugins.list_name_plugin():
        others = [other for other in plugins.get_plugins() if other is not plugin]
        try:
            plugins.subset_hook_caller("add_cli", others)(app=app)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # noqa: BLE001 - whatever a plugin does, the others go on
            _left_out(name, f"adds no commands: {registry.in_words(error)}")


def _left_out(name: str, what: str) -> None:
    """Warn of an observer, `distribution:entry point`, and say how to be rid of it."""
    distribution, _, entry = name.partition(":")
    remedy = registry.remedy(distribution)
    warnings.warn(f"the plugin '{entry}' of {distribution} {what}; {remedy}", RuntimeWarning, stacklevel=3)
