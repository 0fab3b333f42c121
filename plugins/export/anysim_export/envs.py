"""Envs of recorded runs, in which their episodes begin anew."""

from collections.abc import Mapping
from typing import Any

from anysim.record.manifest import Manifest
from anysim.record.replay import begin
from anysim.task.env import TaskEnv


def env_of(spec: Mapping[str, Any], engine: str | None = None) -> TaskEnv:
    """One env of a run, by its resolved spec; with another engine in place of the recorded one, with its defaults."""
    from anysim.api import make

    plain: dict[str, Any] = {**spec, "num_envs": 1}
    if engine is not None and engine != plain["engine"]["name"]:
        plain["engine"] = {"name": engine}
    return make(plain, curriculum=True)


class EpisodeEnv:
    """An env in which recorded episodes begin, kept as long as they are of one run."""

    def __init__(self, engine: str | None) -> None:
        """`engine` is asked in place of the recorded one, where it is given."""
        self._engine = engine
        self._env: tuple[dict[str, Any], TaskEnv] | None = None

    def begun(self, manifest: Manifest) -> TaskEnv:
        """The env, in which this episode has begun."""
        if self._env is None or self._env[0] != manifest.spec:
            self.close()
            self._env = manifest.spec, env_of(manifest.spec, self._engine)
        begin(self._env[1], manifest)
        return self._env[1]

    def close(self) -> None:
        """Free the engine."""
        if self._env is not None:
            self._env[1].close()
            self._env = None
