"""Crossings of tiles: how far a policy of `go1_velocity_rough` gets on each kind and level, on every engine.

    python benchmarks/rough_walking.py [POLICY ...] [--robot NAME] [--engines mujoco,sapien] [-n 16] [--blind]
        [--out FILE]

POLICY is what `anysim evaluate --policy` takes, or the trot and the shipped policy. The robot is that of level L0. It
begins in any direction in the middle of a tile, and is told to walk forward at 0.5 m/s for 10 s: it got through
where it left the tile, which ends 3 m from its middle, and did not fall before. `--blind` takes the height scan from
the observations, for policies of `go1_velocity`. Nothing here is a time. `--out FILE.json` keeps what was found, in
place of what is there of the same policy on the same engine.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

import anysim
from anysim.managers.terrain import COLUMN, LEVEL
from anysim.math.statistics import wilson
from anysim_evaluation.policy import make_policy

SPEED, SECONDS = 0.5, 10.0
ENVS = {"mujoco": 320}
"""Envs that are stepped together; 4 where each env has ground of its own."""
BLIND = (
    "task.observations.policy=[{term: base_lin_vel, robot: dog}, {term: base_ang_vel, robot: dog}, "
    "{term: projected_gravity, robot: dog}, {term: tasks.goal_velocity, goal: walk}, {term: channel_joint_pos, "
    "robot: dog, channel: base}, {term: channel_joint_vel, robot: dog, channel: base}, last_action, "
    "{term: tasks.clock, frequency: 2.5}]"
)


class Crossings(NamedTuple):
    """Of tiles, by level and column: their kinds, and (L, C) how many of `n` were left on foot, and how many fell."""

    kinds: tuple[str, ...]
    n: int
    through: np.ndarray
    fell: np.ndarray


def cross(policy: str, engine: str, n: int, changes: Sequence[str] = (), robot: str | None = None) -> Crossings:
    """Walk from the middle of every tile, n times."""
    overrides = [
        "level=L0",
        "record.cameras=[]",
        "world.cameras.front.channels=[]",
        f"task.command.walk={{forward: {SPEED}, left: 0.0, turn: 0.0, still: 0.0, straight: 0.0}}",
        *changes,
    ]
    width = ENVS.get(engine, 4)
    task = {"source": "go1_velocity_rough", "robot": robot, "overrides": overrides}
    with anysim.make(**task, engine=engine, num_envs=width, curriculum=True) as env:
        terrain = env.scene.terrain
        assert terrain is not None
        edge = 0.5 * env.spec.world.terrain.tiling.size
        shape = (terrain.rows, terrain.columns)
        kinds = tuple(_named(column) for column in env.spec.world.terrain.tiling.columns)
        jobs = [(level, column) for _ in range(n) for level in range(shape[0]) for column in range(shape[1])]
        through, fell = np.zeros(shape, dtype=int), np.zeros(shape, dtype=int)
        made = make_policy(env, policy)
        root = env.engine.index.entity("dog").root
        steps = round(SECONDS / env.engine.world.physics.control_dt)
        for first in range(0, len(jobs), width):
            some = jobs[first : first + width]
            chosen = np.arange(width) < len(some)
            ids = np.flatnonzero(chosen)
            for i, (level, column) in enumerate(some):
                terrain.recall(i, {LEVEL: level, COLUMN: column})
            env.reset(mask=chosen, episode_seeds=ids + 20_000 + first)
            env.retire(np.flatnonzero(~chosen))
            made.reset(ids)
            out = np.zeros(width, dtype=bool)
            for _ in range(steps):
                up = np.flatnonzero(env.running & ~out)
                if not len(up):
                    break
                action = np.zeros((width, env.action_dim))
                action[up] = made.act({group: rows[up] for group, rows in env.obs.items()}, up)
                env.step(action, np.isin(np.arange(width), up))
                away = env.engine.get_state().body_pose[:, root, :2] - env.scene.origin[:, :2]
                out |= env.running & chosen & (np.linalg.norm(away, axis=1) > edge)
            for i, (level, column) in enumerate(some):
                through[level, column] += out[i]
                fell[level, column] += env.status[i] == "failed"
    return Crossings(kinds, n, through, fell)


def _named(column) -> str:
    return column.kind + (" down" if getattr(column, "down", False) else "")


def lines(policy: str, engine: str, found: Crossings) -> list[str]:
    """A Markdown table: a row for each kind, how many of n got through on each level."""
    rows = []
    for c, kind in enumerate(found.kinds):
        cells = [
            f"{found.through[r, c]}" + (f" ({found.fell[r, c]} fell)" if found.fell[r, c] else "")
            for r in range(len(found.through))
        ]
        rows.append(f"| {policy} | {engine} | {kind} | " + " | ".join(cells) + " |")
    total = found.n * len(found.kinds)
    shares = []
    for r in range(len(found.through)):
        low, high = wilson(int(found.through[r].sum()), total)
        shares.append(f"{100 * found.through[r].sum() / total:.0f} % ({100 * low:.0f} to {100 * high:.0f})")
    return [*rows, f"| {policy} | {engine} | all | " + " | ".join(shares) + " |"]


def keep(file: Path, robot: str | None, policy: str, engine: str, found: Crossings) -> None:
    """Write what was found of a robot's policy on an engine."""
    known = json.loads(file.read_text("utf-8")) if file.exists() else []
    other = [one for one in known if (one.get("robot"), one["policy"], one["engine"]) != (robot, policy, engine)]
    counts = {"through": found.through.tolist(), "fell": found.fell.tolist()}
    of = {} if robot is None else {"robot": robot}
    own = {**of, "policy": policy, "engine": engine, "n": found.n, "kinds": list(found.kinds), **counts}
    file.write_text("[\n" + ",\n".join(json.dumps(one) for one in [*other, own]) + "\n]\n", "utf-8")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("policies", nargs="*", default=["expert", "shipped"])
    parser.add_argument("--robot", help="one of the task's alternates in the place of the Go1")
    parser.add_argument("--engines", default="mujoco,pybullet,sapien")
    parser.add_argument("-n", type=int, default=16, help="episodes of each tile")
    parser.add_argument("--blind", action="store_true", help="without the height scan")
    parser.add_argument("--out", type=Path, help="a file of the results, which is added to")
    arguments = parser.parse_args()
    for policy in arguments.policies:
        for engine in arguments.engines.split(","):
            found = cross(policy, engine, arguments.n, [BLIND] if arguments.blind else [], arguments.robot)
            if arguments.out is not None:
                keep(arguments.out, arguments.robot, policy, engine, found)
            levels = " | ".join(f"level {r}" for r in range(len(found.through)))
            print(f"\n| policy | engine | kind | {levels} |\n|" + "---|" * (3 + len(found.through)))
            print("\n".join(lines(policy, engine, found)), flush=True)


if __name__ == "__main__":
    main()
