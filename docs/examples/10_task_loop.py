"""The loop of a task: four envs of pick_cube, random actions, and a reset of those that have ended."""

import numpy as np

import anysim

rng = np.random.default_rng(0)
with anysim.make("pick_cube", num_envs=4, overrides=["task.horizon=40"]) as env:
    env.reset(seed=0)
    low, high = env.action_bounds
    for _ in range(100):
        result = env.step(rng.uniform(low, high, (env.num_envs, env.action_dim)))
        if result.done.any():
            print("ended:", {int(i): str(result.status[i]) for i in np.flatnonzero(result.done)})
            env.reset(mask=result.done)
    print("policy observation:", result.obs["policy"].shape, "reward:", result.reward.round(3))
