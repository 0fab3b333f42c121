"""Lifetime of what skills keep for an env: it ends when the env is closed."""

from collections.abc import Callable
from weakref import WeakKeyDictionary

from anysim.hooks import hookimpl, manager
from anysim.task.env import TaskEnv


class Endings:
    """Calls, once an env is closed, what was left to be called then."""

    def __init__(self) -> None:
        self._calls: WeakKeyDictionary[TaskEnv, list[Callable[[], None]]] = WeakKeyDictionary()

    def add(self, env: TaskEnv, end: Callable[[], None]) -> None:
        """Call `end` when the env is closed; it must not refer to the env."""
        if not manager().is_registered(self):
            manager().register(self)
        self._calls.setdefault(env, []).append(end)

    @hookimpl
    def on_close(self, env: TaskEnv) -> None:
        """End what was kept for it."""
        for end in self._calls.pop(env, ()):
            end()


ENDINGS = Endings()
