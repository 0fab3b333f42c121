"""`--env.type=anysim`: a task of anysim as LeRobot configures environments."""

from dataclasses import dataclass, field
from typing import Any

import gymnasium as gym
from lerobot.configs.types import FeatureType, PolicyFeature  # pyright: ignore[reportMissingImports]
from lerobot.envs.configs import EnvConfig  # pyright: ignore[reportMissingImports]
from lerobot.utils.constants import ACTION, OBS_IMAGES, OBS_STATE  # pyright: ignore[reportMissingImports]

from anysim_adapters.lerobot_env import GROUP, IMAGES, task_env

GYM_ID = "anysim/LeRobot-v0"


def register() -> None:
    """Let gymnasium know the env, without its own wrappers, through which LeRobot does not find the instruction."""
    if GYM_ID not in gym.registry:
        gym.register(
            id=GYM_ID,
            entry_point="anysim_adapters.lerobot_env:LeRobotEnv",
            order_enforce=False,
            disable_env_checker=True,
        )


@EnvConfig.register_subclass("anysim")
@dataclass
class AnysimEnv(EnvConfig):
    """A task, by its name or file, with its engine and overrides; what it shows and takes is read from it."""

    task: str | None = "reach"
    fps: int = 0
    engine: str | None = None
    overrides: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Build the task once, to say what it shows and how often it acts."""
        register()
        if self.features and self.fps:
            return
        with task_env(**self.gym_kwargs) as env:
            self.fps = round(1 / env.engine.world.physics.control_dt)
            self.features = {
                ACTION: PolicyFeature(type=FeatureType.ACTION, shape=(env.action_dim,)),
                "agent_pos": PolicyFeature(type=FeatureType.STATE, shape=(env.observation_sizes[GROUP],)),
            }
            self.features_map = {ACTION: ACTION, "agent_pos": OBS_STATE}
            for name, shape in env.image_shapes.items():
                if len(shape) == 3:
                    camera = name.removeprefix(IMAGES)
                    self.features[f"pixels/{camera}"] = PolicyFeature(type=FeatureType.VISUAL, shape=shape)
                    self.features_map[f"pixels/{camera}"] = f"{OBS_IMAGES}.{camera}"

    @property
    def package_name(self) -> str:
        return "anysim_adapters.lerobot"

    @property
    def gym_id(self) -> str:
        return GYM_ID

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        return {"task": self.task, "engine": self.engine, "overrides": list(self.overrides)}
