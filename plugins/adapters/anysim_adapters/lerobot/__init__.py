"""LeRobot's environments: importing this package registers `--env.type=anysim`, as its parser asks of plugins."""

import gymnasium as gym

from anysim_adapters.lerobot.config import GYM_ID, AnysimEnv

__all__ = ["AnysimEnv"]

if GYM_ID not in gym.registry:
    # without gymnasium's own wrappers, through which LeRobot does not find the instruction
    gym.register(
        id=GYM_ID, entry_point="anysim_adapters.lerobot_env:LeRobotEnv", order_enforce=False, disable_env_checker=True
    )
