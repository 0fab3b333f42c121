"""Ways of what is passed to a person, taken from one, worn on an arm and fed, for the cases of their tasks."""

from collections.abc import Callable

import numpy as np

from anysim.conventions import Array
from anysim.engine.capability import Capability
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim_avatars.hold import FREE, GIVEN, HELD, Hold
from tests.tasks.states import level, put, seen

_START: dict[int, dict[str, Array]] = {}


def _way(env: TaskEnv, share: float, goals: dict[str, Array]) -> None:
    """Objects from where they began to places (N, 7), in straight lines."""
    if share == 0.0:
        _START[id(env)] = {name: seen(env, name) for name in goals}
    for name, goal in goals.items():
        first = _START[id(env)][name]
        put(env, name, np.concatenate([first[:, :3] + share * (goal - first)[:, :3], goal[:, 3:]], axis=1))


def holding(value: int) -> Callable[[TaskEnv], None]:
    """The hand of the person is so."""

    def change(env: TaskEnv) -> None:
        assert env.families is not None
        for hold in env.families.of_kind(Hold):
            hold.holding[:] = value
        env.scene.moment += 1

    return change


def taken(env: TaskEnv, share: float) -> None:
    """The bar out of the person's hand into the robot's."""
    _way(env, share, {"bar": seen(env, "panda.tool")})
    holding(GIVEN if share == 1.0 else HELD)(env)


def given(env: TaskEnv, share: float) -> None:
    """The bar from the table into the person's hand."""
    _way(env, share, {"bar": level(seen(env, "ann.right_palm"), seen(env, "bar"))})
    holding(HELD if share == 1.0 else FREE)(env)


def wiped(env: TaskEnv, share: float) -> None:
    """The sponge to the forearm, along its line pressed on with 3 N, and off it again."""
    if share < 1.0 or Capability.WRENCHES not in env.engine.capabilities:
        _way(env, share, {"sponge": seen(env, "ann.right_forearm_top")})
        return
    body, wrench = [env.engine.index.entity("sponge").root], np.zeros((env.num_envs, 1, 6))
    steps = np.linspace(-0.055, 0.055, 8)
    for number, along in enumerate(steps):
        skin = seen(env, "ann.right_forearm_top")
        at = np.tile([along, 0.0, 0.0205, 0.0, 0.0, 0.0, 1.0], (env.num_envs, 1))
        put(env, "sponge", P.compose(skin, at))
        wrench[:, 0, :3] = P.rotate(skin[:, 3:], np.tile([0.0, 0.0, -3.0], (env.num_envs, 1)))
        for _ in range(12):
            env.engine.apply_wrench(wrench, body)
            env.engine.step(1)
        env.scene.elapsed[:] = number + 1
        env.scene.look(None)
        env.mdp.judge()
    lift(env)
    env.scene.elapsed[:] = len(steps) + 1


def lift(env: TaskEnv) -> None:
    """The sponge off the arm, which the engine has seen."""
    pose = seen(env, "sponge")
    put(env, "sponge", pose + np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0]))
    env.engine.step(1)
    put(env, "sponge", pose + np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0]))


def unwiped(env: TaskEnv) -> None:
    """Nothing has been wiped so far."""
    for memory in env.scene.memories:
        memory.forget(np.arange(env.num_envs))
    env.scene.look(None)


def fed(env: TaskEnv, share: float) -> None:
    """The spoon with its beads to the mouth."""
    spoon = seen(env, "spoon")
    goal = level(seen(env, "ann.bite"), spoon)
    goal[:, :3] = seen(env, "ann.bite")[:, :3]
    moved = goal[:, :3] - (spoon if share == 0.0 else _START[id(env)]["spoon"])[:, :3]
    beads = {f"bead_{i}": (seen(env, f"bead_{i}") if share == 0.0 else _START[id(env)][f"bead_{i}"]) for i in range(3)}
    for name, pose in beads.items():
        beads[name] = np.concatenate([pose[:, :3] + moved, pose[:, 3:]], axis=1)
    _way(env, share, {"spoon": goal, **beads})


def placed(env: TaskEnv, share: float) -> None:
    """One cube to its pad after the other."""
    for name, own in (("red", min(2 * share, 1.0)), ("blue", max(2 * share - 1.0, 0.0))):
        goal = level(seen(env, f"{name}_pad"), seen(env, f"{name}_cube"))
        goal[:, 2] += 0.019
        cube = f"{name}_cube"
        if share == 0.0:
            _START.setdefault(id(env), {})[cube] = seen(env, cube)
        first = _START[id(env)][cube]
        put(env, cube, np.concatenate([first[:, :3] + own * (goal - first)[:, :3], goal[:, 3:]], axis=1))
