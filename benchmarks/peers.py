"""Throughput of `pick_cube` on every engine against ManiSkill's PickCube-v1 on the CPU, in one run, interleaved.

    python benchmarks/peers.py [--engines mujoco …] [--envs 16] [--rate 20] [--substeps 5] [--steps 50] [--rounds 10]

Both sides have a Panda and a cube of 40 mm, the same control rate and physics steps in each control step (those that
ManiSkill itself has, unless asked otherwise), actions that move joints by random amounts, observations of state, a
dense reward and a verdict. ManiSkill simulates one env of a scene on the CPU, so that it has as many scenes, stepped
one after the other. MuJoCo steps its envs in threads; the other engines are measured in one process, and once more in
worker processes, one for each core. ManiSkill draws nothing here, and wants a Vulkan driver all the same; the one that
anysim's SAPIEN takes is used unless VK_ICD_FILENAMES names another. Needs ManiSkill: pip install
'anysim-maniskill[maniskill]'.
"""

import argparse
import os
import time
from collections.abc import Callable
from contextlib import ExitStack
from importlib import import_module
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

import anysim
from anysim_sapien import vulkan

SHARDED = "sharded"
"""After the name of an engine that steps its envs in worker processes."""

Rate = tuple[float, float]
"""Control steps of all envs together in a second: of wall time, of this process's time in all threads."""


class Setting(NamedTuple):
    """What both sides do: `rate` control steps a second, of so many physics steps each."""

    envs: int
    steps: int
    rate: int
    substeps: int


def timed(steps: int, envs: int, step: Callable[[], None]) -> Rate:
    wall, processor = time.perf_counter(), time.process_time()
    for _ in range(steps):
        step()
    return steps * envs / (time.perf_counter() - wall), steps * envs / (time.process_time() - processor)


def ours(name: str, setting: Setting, stack: ExitStack) -> Callable[[], Rate]:
    """A round of `pick_cube`: reset, then so many steps on the clock."""
    (envs, steps, rate, substeps), (engine, *sharded) = setting, name.split()
    lines = ["record.cameras=[]", f"physics.dt={1 / (rate * substeps)}", f"physics.control_dt={1 / rate}"]
    lines += ["engine.shards=auto"] * bool(sharded)
    env = stack.enter_context(anysim.make("pick_cube", engine=engine, num_envs=envs, overrides=lines, seed=0))
    rng = np.random.default_rng(0)
    low, high = env.action_bounds

    def measure() -> Rate:
        env.reset()

        def step() -> None:
            env.step(rng.uniform(low, high, size=(envs, env.action_dim)), None if env.running.all() else env.running)

        return timed(steps, envs, step)

    return measure


def theirs(setting: Setting, stack: ExitStack) -> Callable[[], Rate]:
    """A round of PickCube-v1."""
    import gymnasium
    import torch  # pyright: ignore[reportMissingImports]

    import_module("mani_skill.envs")  # registers them
    torch.set_num_threads(1)
    envs, steps, rate, substeps = setting
    rates = {"sim_freq": rate * substeps, "control_freq": rate}
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
    assert (base.sim_freq, base.control_freq) == (rate * substeps, rate)
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
    parser.add_argument("--rate", type=int, default=20, help="control steps a second")
    parser.add_argument("--substeps", type=int, default=5, help="physics steps of a control step")
    parser.add_argument("--steps", type=int, default=50, help="control steps of a round")
    parser.add_argument("--rounds", type=int, default=10, help="the best of each side counts")
    options = parser.parse_args()
    driver = vulkan.driver_file("auto")
    if driver and not any(os.environ.get(name) for name in vulkan.VARIABLES):
        os.environ["VK_ICD_FILENAMES"] = driver
    if find_spec("mani_skill") is None:
        print(
            "ManiSkill is not installed here: pip install 'anysim-maniskill[maniskill]', in an environment of its own"
        )
        return
    setting = Setting(options.envs, options.steps, options.rate, options.substeps)
    with ExitStack() as stack:
        names = [*options.engines, *(f"{name} {SHARDED}" for name in options.engines if name != "mujoco")]
        sides = {name: ours(name, setting, stack) for name in names}
        sides["ManiSkill"] = theirs(setting, stack)
        rounds = [{name: measure() for name, measure in sides.items()} for _ in range(options.rounds)]
    best = {name: np.max([one[name] for one in rounds], axis=0) for name in sides}
    print("pick_cube and PickCube-v1, {} envs, rounds of {} control steps, {} a second, {} substeps".format(*setting))
    print(f"{'':16} {'steps/s':>9} {'a CPU second':>13} {'ratio':>7} {'of CPU':>7}")
    for name, (wall, processor) in best.items():
        against = best["ManiSkill"]
        figures = f"{wall:9.0f} {processor:13.0f} {wall / against[0]:7.1f} {processor / against[1]:7.1f}"
        if name.endswith(SHARDED):  # the workers' time is not in this process's
            figures = f"{wall:9.0f} {'':13} {wall / against[0]:7.1f}"
        print(f"{name:16} {figures}")


if __name__ == "__main__":
    main()
