"""Throughput of `pick_cube` on every engine against ManiSkill's PickCube-v1 on the CPU, in one run, interleaved.

    python benchmarks/peers.py [--engines mujoco …] [--envs 16] [--steps 50] [--rounds 5]

Both sides have a Panda and a cube of 40 mm, 500 physics steps and 50 control steps a second, actions that move joints
by random amounts, observations of state, a dense reward and a verdict. ManiSkill simulates one env of a scene on the
CPU, so that it has as many scenes, stepped one after the other. It draws nothing here, and wants a Vulkan driver all
the same; the one that anysim's SAPIEN takes is used unless VK_ICD_FILENAMES names another. Needs ManiSkill: pip install
'anysim-maniskill[maniskill]'.
"""

import argparse
import os
import time
from collections.abc import Callable
from contextlib import ExitStack
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np

import anysim
from anysim_sapien import vulkan

RATE = 50
"""Control steps a second."""
SUBSTEPS = 10
"""Physics steps in each."""

Rate = tuple[float, float]
"""Control steps of all envs together in a second: of wall time, of processor time of all threads."""


def timed(steps: int, envs: int, step: Callable[[], None]) -> Rate:
    wall, processor = time.perf_counter(), time.process_time()
    for _ in range(steps):
        step()
    return steps * envs / (time.perf_counter() - wall), steps * envs / (time.process_time() - processor)


def ours(engine: str, envs: int, steps: int, stack: ExitStack) -> Callable[[], Rate]:
    """A round of `pick_cube`: reset, then so many steps on the clock."""
    lines = ["record.cameras=[]", f"physics.dt={1 / (RATE * SUBSTEPS)}", f"physics.control_dt={1 / RATE}"]
    env = stack.enter_context(anysim.make("pick_cube", engine=engine, num_envs=envs, overrides=lines, seed=0))
    rng = np.random.default_rng(0)
    low, high = env.action_bounds

    def measure() -> Rate:
        env.reset()

        def step() -> None:
            env.step(rng.uniform(low, high, size=(envs, env.action_dim)), None if env.running.all() else env.running)

        return timed(steps, envs, step)

    return measure


def theirs(envs: int, steps: int, stack: ExitStack) -> Callable[[], Rate]:
    """A round of PickCube-v1."""
    import gymnasium
    import torch  # pyright: ignore[reportMissingImports]

    import_module("mani_skill.envs")  # registers them
    torch.set_num_threads(1)
    rates = {"sim_freq": RATE * SUBSTEPS, "control_freq": RATE}
    scenes = [
        gymnasium.make(
            "PickCube-v1",
            num_envs=1,
            obs_mode="state",
            reward_mode="dense",
            control_mode="pd_joint_delta_pos",
            sim_backend="physx_cpu",
            render_backend="none",
            sim_config=rates,
            max_episode_steps=steps + 1,
        )
        for _ in range(envs)
    ]
    for scene in scenes:
        stack.callback(scene.close)
    base: Any = scenes[0].unwrapped
    assert (base.sim_freq, base.control_freq) == (RATE * SUBSTEPS, RATE)
    space: Any = scenes[0].action_space
    rng = np.random.default_rng(0)

    def measure() -> Rate:
        for number, scene in enumerate(scenes):
            scene.reset(seed=number)

        def step() -> None:
            for action, scene in zip(
                rng.uniform(space.low, space.high, size=(envs, *space.shape)), scenes, strict=True
            ):
                scene.step(action.astype(np.float32))

        return timed(steps, envs, step)

    return measure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engines", nargs="+", default=("mujoco", "pybullet", "sapien"))
    parser.add_argument("--envs", type=int, default=16)
    parser.add_argument("--steps", type=int, default=50, help="control steps of a round")
    parser.add_argument("--rounds", type=int, default=5, help="the best of each side counts")
    options = parser.parse_args()
    driver = vulkan.driver_file("auto")
    if driver and not any(os.environ.get(name) for name in vulkan.VARIABLES):
        os.environ["VK_ICD_FILENAMES"] = driver
    if find_spec("mani_skill") is None:
        print(
            "ManiSkill is not installed here: pip install 'anysim-maniskill[maniskill]', in an environment of its own"
        )
        return
    with ExitStack() as stack:
        sides = {engine: ours(engine, options.envs, options.steps, stack) for engine in options.engines}
        sides["ManiSkill"] = theirs(options.envs, options.steps, stack)
        rounds = [{name: measure() for name, measure in sides.items()} for _ in range(options.rounds)]
    best = {name: np.max([one[name] for one in rounds], axis=0) for name in sides}
    print(f"pick_cube and PickCube-v1, {options.envs} envs, {RATE} control steps of {SUBSTEPS} physics steps a second")
    print(f"{'':10} {'steps/s':>9} {'a CPU second':>13} {'ratio':>7} {'of CPU':>7}")
    for name, (wall, processor) in best.items():
        against = best["ManiSkill"]
        figures = f"{wall:9.0f} {processor:13.0f} {wall / against[0]:7.1f} {processor / against[1]:7.1f}"
        print(f"{name:10} {figures}")


if __name__ == "__main__":
    main()
