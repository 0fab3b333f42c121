"""Lifetime of what skills share in an env, such as its arms: made once, and given up when the env is closed."""

from collections.abc import Callable, Hashable
from typing import Generic, TypeVar
from weakref import WeakKeyDictionary

from anysim.hooks import hookimpl, manager
from anysim.task.env import TaskEnv

K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


class PerEnv(Generic[K, V]):
    """Things of each env by key. They may refer to the env: it forgets them when it is closed."""

    def __init__(self, end: Callable[[V], None] | None = None) -> None:
        """`end` is called for each of them when its env is closed."""
        self._end = end
        self._kept: WeakKeyDictionary[TaskEnv, dict[K, V]] = WeakKeyDictionary()

    def of(self, env: TaskEnv, key: K, make: Callable[[], V]) -> V:
        """The one of a key, made where there is none yet."""
        if not manager().is_registered(self):
            manager().register(self)
        kept = self._kept.setdefault(env, {})
        if key not in kept:
            kept[key] = make()
        return kept[key]

    def known(self, env: TaskEnv) -> dict[K, V]:
        """Those of an env that have been made."""
        return dict(self._kept.get(env, {}))

    @hookimpl
    def on_close(self, env: TaskEnv) -> None:
        """Give up what was kept for it."""
        for thing in self._kept.pop(env, {}).values():
            if self._end is not None:
                self._end(thing)
