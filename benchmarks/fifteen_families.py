"""Random play in a world with all fifteen families at once: minutes of it on each engine, filmed, saved and replayed.

    python benchmarks/fifteen_families.py [--engine mujoco,pybullet,sapien] [--episodes 2] [--seconds 60] [--out FOLDER]

The world is docs/worlds/fifteen_families.yaml. Two envs play side by side: the arm gets another random command twice a
second, and things get random pushes. What is recorded goes to FOLDER, with a film of each episode, and four stills of
the first. In the middle of the first episodes the envs are saved; in the end they go on from there for ten seconds in
envs that were newly made, and what everything is like is compared before each step, to the bit. Printed are how the
episodes ended, how fast and how far off matter was at most, and the processor time of a physics step of one env.
"""

import argparse
import hashlib
import json
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import anysim
from anysim.conventions import Array
from anysim.families.cosolver import CoSolver
from anysim_recording.collector import Collector

WORLD = Path(__file__).parents[1] / "docs" / "worlds" / "fifteen_families.yaml"
NUM_ENVS = 2
HELD = 25
"""Control steps for which a command is held."""
STILLS = 4
AGAIN = 500
"""Control steps at most that are done once more, from what was saved in the middle."""


def digest(env: anysim.TaskEnv) -> bytes:
    """Of every number that an engine and families know."""
    state, known = env.engine.get_state(), hashlib.sha256()
    assert env.families is not None
    for array in (state.body_pose, state.body_twist, state.joint_pos, state.joint_vel):
        known.update(np.ascontiguousarray(array).tobytes())
    for _, array in sorted(env.families.snapshot(np.arange(env.num_envs)).items()):
        known.update(np.ascontiguousarray(array).tobytes())
    return known.digest()


class Play:
    """A source of actions for the collector: random ones, each held for half a second.

    Attributes:
        middle: what was saved in the middle of the first episodes.
        actions, digests: of the steps after it.
        fastest: [m/s] of any point of matter, by family.
        farthest: [m] of any point from the middle of the world, by family.
    """

    name = "play"

    def __init__(self, env: anysim.TaskEnv, steps: int, stills: Path | None) -> None:
        assert env.families is not None
        self._env, self._steps, self._stills = env, steps, stills
        self._random = np.random.default_rng(7)
        self._done, self._round = 0, 0
        self._action = np.zeros((env.num_envs, env.action_dim))
        names = env.spec.world.families or {}
        self._matter = [
            name for name in names if isinstance(family := env.families.family(name), CoSolver) and family.drawn
        ]
        self.middle: Any = None
        self.actions, self.digests = list[Array](), list[bytes]()
        self.fastest, self.farthest = dict.fromkeys(self._matter, 0.0), dict.fromkeys(self._matter, 0.0)

    def begin(self, env_ids: Array) -> None:
        """Episodes begin: those of all envs at the same time."""
        if len(env_ids) == self._env.num_envs:
            self._done, self._round = 0, self._round + 1

    def act(self, env_ids: Array) -> Array:
        """(N, A) the commands of now."""
        if self._done % HELD == 0:
            self._action = self._random.uniform(-1.0, 1.0, self._action.shape)
        if self._round == 1:
            self._first()
        self._look()
        self._done += 1
        return self._action

    def _first(self) -> None:
        """Of the first episodes: save the middle, follow what comes after it, and take stills."""
        if self._done == self._steps // 2:
            self.middle = self._env.snapshot()
        if self.middle is not None and len(self.actions) < AGAIN:
            self.actions.append(self._action.copy())
            self.digests.append(digest(self._env))
        every = max(1, self._steps // STILLS)
        if self._stills is not None and (self._done + 1) % every == 0:
            seen = np.concatenate([*self._env.engine.render("front")["rgb"]], axis=1)
            Image.fromarray(seen).save(self._stills / f"{self._env.engine.name}_{self._done + 1}.png")

    def _look(self) -> None:
        """How fast and how far off matter is."""
        assert self._env.families is not None
        for name in self._matter:
            state = self._env.families.state(name)
            there = state.fields.get("there")
            rows = np.ones(state.points.shape[:2], dtype=bool) if there is None else there
            if rows.any():
                speed, away = (float(np.linalg.norm(x[rows], axis=-1).max()) for x in (state.velocities, state.points))
                self.fastest[name] = max(self.fastest[name], speed)
                self.farthest[name] = max(self.farthest[name], away)

    def gave_up(self, env_ids: Array) -> Array:
        """(n,) none."""
        return np.zeros(len(env_ids), dtype=bool)

    def solved(self, env_ids: Array) -> Array:
        """(n,) none: there is no task."""
        return np.zeros(len(env_ids), dtype=bool)

    def ended(self, env: int, success: bool) -> dict[str, Any]:
        """Nothing to tell."""
        return {}

    def describe(self, env: int) -> dict[str, Any]:
        """Nothing to tell."""
        return {}


def made(engine: str, steps: int) -> anysim.TaskEnv:
    """The envs, whose episodes have so many control steps."""
    return anysim.make(WORLD, engine=engine, num_envs=NUM_ENVS, overrides=[f"task.horizon={steps}"])


def play(engine: str, steps: int, episodes: int, folder: Path, *, stills: bool = False) -> dict[str, Any]:
    """Episodes of so many control steps, of which the first ones are gone on with once more from their middle.

    Returns how they ended, whether they went on as before to the bit, and what matter did.
    """
    with made(engine, steps) as env:
        source = Play(env, steps, folder if stills else None)
        results = list(Collector(env, source, folder / engine, episodes, seed=1).run())
    with made(engine, steps) as env:
        env.reset(seed=2)
        env.reset_to(source.middle)
        same, begun = list[bool](), time.process_time()
        for action, expected in zip(source.actions, source.digests, strict=True):
            same.append(digest(env) == expected)
            env.step(action)
        cost = (time.process_time() - begun) / (len(same) * NUM_ENVS * env.engine.world.physics.substeps)
    return {
        "engine": engine,
        "episodes": [f"{one.status}, {one.steps} steps{one.fault and ', ' + one.fault}" for one in results],
        "identical": len(same) > 0 and all(same),
        "ms": round(1e3 * cost, 2),
        "fastest": {name: round(value, 2) for name, value in source.fastest.items()},
        "farthest": {name: round(value, 2) for name, value in source.farthest.items()},
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engine", default="mujoco,pybullet,sapien", help="engines, separated by commas")
    parser.add_argument("--episodes", type=int, default=NUM_ENVS, help="in all, of two envs")
    parser.add_argument("--seconds", type=float, default=60.0, help="of an episode")
    parser.add_argument("--out", type=Path, help="where records, films and stills go; nothing is kept if not given")
    asked = parser.parse_args()
    for name in asked.engine.split(","):
        with tempfile.TemporaryDirectory() as scratch:
            where = asked.out or Path(scratch)
            where.mkdir(parents=True, exist_ok=True)
            found = play(name, round(asked.seconds / 0.02), asked.episodes, where, stills=asked.out is not None)
            print(json.dumps(found), flush=True)
