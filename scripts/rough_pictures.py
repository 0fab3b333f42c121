"""Pictures of a walk over rough ground: `python scripts/rough_pictures.py POLICY [FILE]`, drawn by MuJoCo.

Two rows for each level of `go1_velocity_rough` that is shown, with its ten kinds of tiles: where the policy is after
four seconds at 0.5 m/s, seen from the side.
"""

import argparse
from pathlib import Path

import numpy as np

import anysim
from anysim.managers.terrain import COLUMN, LEVEL
from anysim_evaluation.policy import make_policy

LEVELS, SECONDS, KINDS, COLUMNS = (1, 4), 4.0, 10, 5
CHANGES = [
    "level=L0",
    "record.cameras=[]",
    "task.command.walk={forward: 0.5, left: 0.0, turn: 0.0, still: 0.0, straight: 0.0}",
    "world.robots.dog={position: [0.0, 0.0, 0.0], yaw: 0.0}",
    "world.cameras.front={from: [0.6, -3.4, 1.5], look_at: [1.3, 0.0, 0.0], fov: 30.0, size: [240, 180]}",
    "world.lights.key={direction: [0.8, 0.3, -0.6], intensity: 0.75}",
]


def main() -> None:
    """Walk, and draw."""
    from PIL import Image

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("policy", help="what `anysim evaluate --policy` takes")
    parser.add_argument("file", nargs="?", type=Path, default=Path("docs/images/rough_walking.jpg"))
    arguments = parser.parse_args()
    tiles = [(level, column) for level in LEVELS for column in range(KINDS)]
    count = len(tiles)
    with anysim.make("go1_velocity_rough", engine="mujoco", num_envs=count, overrides=CHANGES, curriculum=True) as env:
        assert env.scene.terrain is not None
        for k, (level, column) in enumerate(tiles):
            env.scene.terrain.recall(k, {LEVEL: level, COLUMN: column})
        env.reset(episode_seeds=list(range(count)))
        policy, every = make_policy(env, arguments.policy), np.arange(count)
        policy.reset(every)
        for _ in range(round(SECONDS / env.engine.world.physics.control_dt)):
            up = np.flatnonzero(env.running)
            action = np.zeros((count, env.action_dim))
            action[up] = policy.act({group: rows[up] for group, rows in env.obs.items()}, up)
            env.step(action, env.running.copy())
        shown = env.engine.render("front")["rgb"]
    rows = [np.concatenate(list(shown[k : k + COLUMNS]), axis=1) for k in range(0, count, COLUMNS)]
    Image.fromarray(np.concatenate(rows)).save(arguments.file, quality=75, optimize=True)


if __name__ == "__main__":
    main()
