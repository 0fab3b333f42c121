"""The benchmark `gymnasium-robotics`: those of its environments that say whether their goal is reached."""

from collections.abc import Mapping, Sequence
from importlib import import_module, metadata
from pathlib import Path
from traceback import extract_tb
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.errors import PluginError
from anysim.task.contract import Obs
from anysim_evaluation.external.benchmark import ExternalStep

PACKAGE = "gymnasium_robotics"
JUDGED = frozenset({"fetch", "shadow_dexterous_hand", "adroit_hand", "maze"})
"""Its modules whose environments have a verdict in their `info`."""
VERDICTS = ("is_success", "success")
"""What that verdict is called there."""


class GymnasiumRobotics:
    """Fetch, hand and maze environments of gymnasium-robotics, each in its newest version that runs on MuJoCo."""

    def __init__(self) -> None:
        """Import and register them.

        Raises:
            PluginError: the package is not installed.
        """
        try:
            self._gymnasium: Any = import_module("gymnasium")
            self._gymnasium.register_envs(import_module(PACKAGE))
        except ImportError as error:
            raise PluginError(
                f"the benchmark gymnasium-robotics needs its package ({error}): "
                "pip install 'anysim-evaluation[gymnasium-robotics]'"
            ) from None
        self.version = f"{PACKAGE} {metadata.version('gymnasium-robotics')}"

    def tasks(self) -> Sequence[str]:
        """Names as `FetchReach-v4`, in the order of the alphabet."""
        newest: dict[str, Any] = {}
        for spec in self._gymnasium.registry.values():
            where = str(spec.entry_point).split(".")
            if where[0] != PACKAGE or not JUDGED & {*where} or "MujocoPy" in str(spec.entry_point):
                continue
            if spec.name not in newest or (spec.version or 0) > (newest[spec.name].version or 0):
                newest[spec.name] = spec
        return sorted(spec.id for spec in newest.values())

    def make(self, task: str) -> "GymnasiumEnv":
        """An environment of a task, without pictures.

        Raises:
            PluginError: the package cannot make it here, as where it does not fit the MuJoCo that is installed.
        """
        try:
            env = self._gymnasium.make(task)
        except Exception as error:
            raise PluginError(
                f"{self.version} cannot make '{task}' with mujoco {import_module('mujoco').__version__}: "
                f"{type(error).__name__} in {_place(error)}; Adroit and maze environments run with every mujoco 3"
            ) from error
        return GymnasiumEnv(env, int(env.spec.max_episode_steps))


class GymnasiumEnv:
    """An environment of Gymnasium's API with a verdict in its `info`."""

    def __init__(self, env: Any, horizon: int) -> None:
        self._env, self.horizon = env, horizon
        self.low, self.high = (
            np.asarray(bound, dtype=float) for bound in (env.action_space.low, env.action_space.high)
        )
        self._info: Mapping[str, Any] = {}

    def reset(self, seed: int) -> Obs:
        """Begin the episode of a seed."""
        obs, self._info = self._env.reset(seed=seed)
        return _named(obs)

    def step(self, action: Array) -> ExternalStep:
        """One step."""
        obs, reward, terminated, _, self._info = self._env.step(action.astype(self._env.action_space.dtype))
        return ExternalStep(_named(obs), float(reward), bool(terminated))

    def verdict(self) -> bool:
        """What `info` says."""
        return any(bool(self._info.get(name, False)) for name in VERDICTS)

    def close(self) -> None:
        """Close the environment."""
        self._env.close()


def _place(error: BaseException) -> str:
    """The function of the package that raised."""
    frames = [frame for frame in extract_tb(error.__traceback__) if PACKAGE in frame.filename]
    return f"{Path(frames[-1].filename).name}, {frames[-1].name}" if frames else "its making"


def _named(obs: Any) -> Obs:
    """Observations by name; a single array is `observation`."""
    return (
        {name: np.asarray(values) for name, values in obs.items()}
        if isinstance(obs, Mapping)
        else {"observation": np.asarray(obs)}
    )
