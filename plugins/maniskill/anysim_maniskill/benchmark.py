"""The benchmark `maniskill`: ManiSkill's own environments on the processor, judged by their own rules."""

from collections.abc import Sequence
from importlib import import_module, metadata
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import PluginError

STATE = "state"
"""What the one observation is called: ManiSkill's flat state."""


class ExternalStep(NamedTuple):
    """What a step gave: the observation by name, the reward, and whether the environment has ended the episode."""

    obs: dict[str, Array]
    reward: float
    terminated: bool


class ManiSkill:
    """Environments of ManiSkill on the processor, with the state as observation and their default control."""

    def __init__(self) -> None:
        """Import and register them.

        Raises:
            PluginError: mani_skill or torch is not installed.
        """
        try:
            self._make: Any = import_module("gymnasium").make
            import_module("mani_skill.envs")  # registers them
            self._registered: Any = import_module("mani_skill.utils.registration").REGISTERED_ENVS
        except ImportError as error:
            raise PluginError(
                f"the benchmark maniskill needs mani_skill and torch ({error}): pip install "
                "'anysim-maniskill[maniskill]', best in an environment of its own"
            ) from None
        self.version = f"mani_skill {metadata.version('mani_skill')}"

    def tasks(self) -> Sequence[str]:
        """Names as `PickCube-v1`, in the order of the alphabet: those with a horizon and a rule of success."""
        return sorted(name for name, spec in self._registered.items() if spec.max_episode_steps and _judges(spec.cls))

    def make(self, task: str) -> "ManiSkillEnv":
        """An environment of a task, without pictures.

        Raises:
            PluginError: ManiSkill cannot make it here, as without the assets that it downloads.
        """
        try:
            env = self._make(task, num_envs=1, obs_mode="state", sim_backend="physx_cpu", render_backend="none")
        except (Exception, SystemExit) as error:
            raise PluginError(
                f"mani_skill cannot make '{task}' here: {type(error).__name__}: {error}{_remedy(error)}"
            ) from error
        return ManiSkillEnv(env, int(self._registered[task].max_episode_steps))


def _remedy(error: BaseException) -> str:
    """Its physics asks for a Vulkan device even where nothing is drawn."""
    if "rendering device" not in str(error):
        return ""
    return "; install a Vulkan driver (mesa-vulkan-drivers, or chromium's) and name its .json file in VK_ICD_FILENAMES"


def _judges(kind: Any) -> bool:
    """Whether a class of environments has a rule of its own."""
    return kind.evaluate is not import_module("mani_skill.envs.sapien_env").BaseEnv.evaluate


class ManiSkillEnv:
    """One environment of ManiSkill."""

    def __init__(self, env: Any, horizon: int) -> None:
        self._env, self.horizon = env, horizon
        space = env.unwrapped.single_action_space
        self.low, self.high = np.asarray(space.low, dtype=float), np.asarray(space.high, dtype=float)

    def reset(self, seed: int) -> dict[str, Array]:
        """Begin the episode of a seed."""
        return _named(self._env.reset(seed=seed)[0])

    def step(self, action: Array) -> ExternalStep:
        """One step. ManiSkill ends an episode with success or failure; which, the verdict says."""
        obs, reward, terminated, *_ = self._env.step(action.astype(np.float32))
        return ExternalStep(_named(obs), float(reward), bool(terminated))

    def verdict(self) -> bool:
        """Success by the environment's own `evaluate`.

        Raises:
            PluginError: it says nothing of success.
        """
        told = self._env.unwrapped.evaluate()
        if "success" not in told:
            raise PluginError(f"the rule of '{self._env.spec.id}' says nothing of success; it cannot be evaluated")
        return bool(told["success"])

    def close(self) -> None:
        """Close the environment."""
        self._env.close()


def _named(obs: Any) -> dict[str, Array]:
    return {STATE: np.asarray(obs, dtype=np.float32).reshape(-1)}
