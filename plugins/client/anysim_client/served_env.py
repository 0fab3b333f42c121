"""Envs that are stepped elsewhere: what those of one service and those of a pool have in common."""

from abc import ABC, abstractmethod
from typing import Any, Self

import numpy as np

from anysim.conventions import Array
from anysim.task.contract import STATUS_NAMES


class ServedEnv(ABC):
    """An env with the methods of `TaskEnv`; it keeps what is known of its episodes."""

    def __init__(self, num_envs: int) -> None:
        self.num_envs = num_envs
        self.scene = _Scene(self)
        self._code, self._running = np.zeros(num_envs, np.int8), np.zeros(num_envs, bool)
        self._info: dict[str, Array] = {}
        self._closed = False

    @property
    def status(self) -> Array:
        """(N,) the word of `Status` for each env."""
        self._refresh()
        return STATUS_NAMES[self._code]

    @property
    def info(self) -> dict[str, Array]:
        """Info of all envs now, as in `StepResult.info`."""
        self._refresh()
        return {name: rows.copy() for name, rows in self._info.items()}

    @property
    def running(self) -> Array:
        """(N,) bool: reset, and not ended."""
        self._refresh()
        return self._running.copy()

    @abstractmethod
    def details(self) -> list[dict[str, Any]]:
        """Everything that is known of each env's episode, by name."""

    def instruction(self, env: int) -> str:
        """The task in words, as it is in an env's episode."""
        return self.details()[env].get("instruction", "")

    def _refresh(self) -> None:
        """See to it that what is kept is of now."""

    def close(self) -> None:
        """End the sessions. May be called twice."""
        if not self._closed:
            self._closed = True
            self._end()

    @abstractmethod
    def _end(self) -> None:
        """End the sessions."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class _Scene:
    """Of the scene, what learners read."""

    terrain = None

    def __init__(self, env: ServedEnv) -> None:
        self._env = env

    @property
    def elapsed(self) -> Array:
        """(N,) control steps of each env's episode."""
        return self._env.info["elapsed_steps"]
