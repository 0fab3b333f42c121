"""Installed tasks as environments of gymnasium: importing this module registers `anysim/TASK-v0` for each.

`gymnasium.make("anysim_learning.envs:anysim/pick_cube-v0", engine="sapien")` imports it by itself. Nothing of a task is
read before it is made.
"""

from typing import Any

import gymnasium as gym
from gymnasium.vector import AutoresetMode

from anysim import registry
from anysim_learning.gymnasium import ActionForm, GymEnv, GymVectorEnv

NAMESPACE = "anysim"


def register() -> None:
    """Tell gymnasium of the installed tasks that it does not know yet."""
    for task in registry.names("tasks"):
        name = f"{NAMESPACE}/{task}-v0"
        if name not in gym.registry:
            gym.register(
                name,
                entry_point=f"{__name__}:make_single",
                vector_entry_point=f"{__name__}:make_vector",
                kwargs={"task": task},
            )


def make_single(
    task: str, *, render_mode: str | None = None, action: ActionForm = "flat", privileged: bool = False, **options: Any
) -> GymEnv:
    """One env of a task; `options` are those of `anysim.make`."""
    from anysim.api import make

    return GymEnv(make(task, num_envs=1, **options), render_mode, action, privileged)


def make_vector(
    task: str,
    num_envs: int = 1,
    *,
    autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
    render_mode: str | None = None,
    action: ActionForm = "flat",
    privileged: bool = False,
    **options: Any,
) -> GymVectorEnv:
    """Many envs of a task, stepped together; `options` are those of `anysim.make`."""
    from anysim.api import make

    return GymVectorEnv(make(task, num_envs=num_envs, **options), autoreset_mode, render_mode, action, privileged)


register()
