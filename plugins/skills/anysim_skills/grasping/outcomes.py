"""Outcomes of grasps from banks: an observer tells the grasps of an env when its episodes begin and end."""

from typing import Protocol
from weakref import WeakKeyDictionary

from anysim.conventions import Array
from anysim.hooks import hookimpl, manager
from anysim.task.env import TaskEnv


class EpisodeListener(Protocol):
    """What is told of episodes."""

    @property
    def banks(self) -> "KeptBanks":
        """What is kept once the env is closed."""
        ...

    def begun(self, ids: Array) -> None:
        """Episodes begin in these envs."""
        ...

    def ended(self, ids: Array) -> None:
        """Episodes have ended in these envs."""
        ...


class KeptBanks(Protocol):
    """What is kept once the env is closed."""

    def save(self) -> None:
        """Write it."""
        ...


class _Outcomes:
    """The grasps from banks of each env, which hold for as long as it is open."""

    def __init__(self) -> None:
        self._watched: WeakKeyDictionary[TaskEnv, list[EpisodeListener]] = WeakKeyDictionary()

    def watch(self, env: TaskEnv, grasps: EpisodeListener) -> None:
        """Tell these grasps of the episodes of an env."""
        if not manager().is_registered(self):
            manager().register(self)
        self._watched.setdefault(env, []).append(grasps)

    @hookimpl
    def before_episode(self, env: TaskEnv, env_ids: Array) -> None:
        """Episodes begin."""
        for grasps in self._watched.get(env, ()):
            grasps.begun(env_ids)

    @hookimpl
    def after_episode(self, env: TaskEnv, env_ids: Array) -> None:
        """Episodes have ended."""
        for grasps in self._watched.get(env, ()):
            grasps.ended(env_ids)

    @hookimpl
    def on_close(self, env: TaskEnv) -> None:
        """Outcomes are written."""
        for grasps in self._watched.pop(env, ()):
            grasps.banks.save()


OUTCOMES = _Outcomes()
