"""Train with Stable-Baselines3: `pip install stable-baselines3` first, which brings torch."""
# torch is not in the environment of development
# pyright: reportMissingImports=false

from gymnasium.wrappers import FilterObservation, FlattenObservation
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv

import anysim
from anysim_learning.gymnasium import GymEnv


def make_env():
    """One env with the observation that a policy may have, as one vector."""
    env = GymEnv(anysim.make("pick_cube", engine="mujoco"))
    return FlattenObservation(FilterObservation(env, ["policy"]))


model = PPO("MlpPolicy", DummyVecEnv([make_env] * 2), n_steps=64, batch_size=64, seed=0, device="cpu")
model.learn(total_timesteps=256)
print(f"{model.num_timesteps} steps")
model.get_env().close()
