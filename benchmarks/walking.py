"""Walks of a policy of `go1_velocity` on every engine: five commands, shoves, a slippery floor and rough ground.

    python benchmarks/walking.py [POLICY ...] [--engines mujoco,sapien] [-n 8] [--rows commands,shoves,floors]

POLICY is what `anysim evaluate --policy` takes, or the trot and the shipped policy. The robot is that
of level L0. Errors are the root mean squares of the velocity along the ground after the first 1.5 s, within a stride
included; falls are of 8 s at 0.5 m/s, with Wilson's intervals at 95 %. Nothing here is a time.
"""

import argparse
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

import anysim
from anysim.engine.state import State
from anysim.math import pose as P
from anysim.math.statistics import wilson
from anysim_evaluation.policy import make_policy

COMMANDS = ((0.5, 0.0, 0.0), (0.9, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, 0.0, 0.8), (0.5, 0.2, 0.5))
"""Forward and to the left [m/s], turning [rad/s]."""
SECONDS, SETTLED = 8.0, 1.5


class Walk(NamedTuple):
    """What came of some envs: how many fell, mean velocity (3,), and the errors of velocity and turn."""

    fell: int
    velocity: np.ndarray
    error: float
    turn_error: float


def shoved(speed: float) -> list[str]:
    """A shove of this speed in any direction every two seconds."""
    return [
        f"task.events.shove.velocity={{range: [[{-speed}, {-speed}, 0.0], [{speed}, {speed}, 0.0]]}}",
        "task.events.shove.every=2.0",
    ]


def rough(height: float) -> list[str]:
    """Ground whose heights vary by this much both ways, in cells of 20 cm, about a flat start."""
    ground = (
        f"kind: rough, amplitude: {height}, grain: 0.2, cell: 0.1, size: [16.0, 16.0], platform: 1.0, friction: 0.8"
    )
    return [f"world.terrain={{{ground}}}"]


ROUGH = (0.02, 0.04, 0.06)
FLOORS = {
    "friction 0.3": ["world.robots.dog.dynamics.link_friction_scale=0.375", "world.terrain.friction=0.2"],
    **{f"rough, {100 * height:g} cm": rough(height) for height in ROUGH},
}
SHOVES = {f"shoves of {speed:g} m/s": shoved(speed) for speed in (0.5, 1.0)}


def walk(policy: str, engine: str, command: tuple[float, ...], num_envs: int, changes: list[str]) -> Walk:
    """Walk in all envs at once; an env that has fallen is left alone."""
    asked = [f"task.command.walk.{key}={v}" for key, v in zip(("forward", "left", "turn"), command, strict=True)]
    asked += ["task.command.walk.still=0.0", "task.command.walk.straight=0.0"]
    overrides = ["record.cameras=[]", "world.cameras.front.channels=[]", "level=L0", *asked, *changes]
    with anysim.make("go1_velocity", engine=engine, num_envs=num_envs, overrides=overrides) as env:
        everyone = np.arange(num_envs)
        env.reset(episode_seeds=everyone + 20_000)
        made = make_policy(env, policy)
        made.reset(everyone)
        base, seen = env.engine.index.entity("dog").root, []
        steps = round(SECONDS / env.engine.world.physics.control_dt)
        first = round(SETTLED / env.engine.world.physics.control_dt)
        for step in range(steps):
            up = np.flatnonzero(env.running)
            if not len(up):
                break
            action = np.zeros((num_envs, env.action_dim))
            action[up] = made.act({group: rows[up] for group, rows in env.obs.items()}, up)
            env.step(action, None if len(up) == num_envs else env.running)
            if step >= first:
                seen.append(_own(env.engine.get_state(), base)[env.running])
        fell = int((env.status == "failed").sum())
    rows = np.concatenate(seen) if seen else np.zeros((0, 3))
    if not len(rows):
        return Walk(fell, np.full(3, np.nan), np.nan, np.nan)
    wrong = rows - np.array(command)
    error, turn = np.sqrt((wrong[:, :2] ** 2).sum(axis=1).mean()), np.sqrt((wrong[:, 2] ** 2).mean())
    return Walk(fell, rows.mean(axis=0), float(error), float(turn))


def _own(state: State, base: int) -> np.ndarray:
    """(N, 3) velocity of the base along its own x and y, and its rate about its own z."""
    turn, twist = state.body_pose[:, base, 3:], state.body_twist[:, base]
    return np.concatenate([P.rotate_inverse(turn, twist[:, :3])[:, :2], P.rotate_inverse(turn, twist[:, 3:])[:, 2:]], 1)


def lines(policy: str, engines: list[str], num_envs: int, rows: list[str]) -> Iterator[str]:
    """Rows of a Markdown table for a policy."""
    if "commands" in rows:
        for command in COMMANDS:
            walks = [walk(policy, engine, command, num_envs, []) for engine in engines]
            asked = ", ".join(f"{value:g}" for value in command)
            yield f"| {policy} | {asked} | " + " | ".join(_tracked(w, command, num_envs) for w in walks) + " |"
    for group, changes in (("shoves", SHOVES), ("floors", FLOORS)):
        for name, change in changes.items() if group in rows else ():
            walks = [walk(policy, engine, COMMANDS[0], num_envs, change) for engine in engines]
            yield f"| {policy} | {name} | " + " | ".join(_fallen(w.fell, num_envs) for w in walks) + " |"


def _tracked(walk: Walk, command: tuple[float, ...], num_envs: int) -> str:
    part = int(np.argmax(np.abs(command)))
    fallen = f"; {walk.fell} of {num_envs} fell" if walk.fell else ""
    return f"{walk.velocity[part]:.3f} / {walk.error:.3f}, {walk.turn_error:.3f}{fallen}"


def _fallen(fell: int, num_envs: int) -> str:
    low, high = wilson(fell, num_envs)
    return f"{fell} of {num_envs} fell ({100 * low:.0f} to {100 * high:.0f} %)"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("policies", nargs="*", default=["expert", "shipped"])
    parser.add_argument("--engines", default="mujoco,pybullet,sapien")
    parser.add_argument("-n", type=int, default=8, help="envs of each cell")
    parser.add_argument("--rows", default="commands,shoves,floors")
    arguments = parser.parse_args()
    engines = arguments.engines.split(",")
    print("| policy | what | " + " | ".join(engines) + " |\n|" + "---|" * (2 + len(engines)))
    for policy in arguments.policies:
        for line in lines(policy, engines, arguments.n, arguments.rows.split(",")):
            print(line, flush=True)


if __name__ == "__main__":
    main()
