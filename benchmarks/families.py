"""The fifteen families on each engine: the suite, snapshots, partial resets, replays, looks, cost.

    python benchmarks/families.py [--engine mujoco,pybullet,sapien] [--families fire,magnet] [--write]

A family stands beside a ball in three envs. The suite of families (`anysim.testing.families`) is called in this
process, with fewer steps than `pytest --pyargs` has; families that an engine holds by itself have no suite of their
own, and are stepped through the same questions. Cost is processor time of a physics step of 4 ms of one env, the engine
with it. With `--write` what was found replaces those rows of docs/families.json, from which scripts/matter_table.py
makes the table of docs/matter.md.
"""

import argparse
import inspect
import json
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import anysim
from anysim import registry
from anysim.api import WATCHING
from anysim.testing.families import fixtures, test_family

ROWS = Path(__file__).parents[1] / "docs" / "families.json"
STEPS = 8
CAMERA = {"look_at": [0.0, 0.0, 0.1], "from": [0.1, -0.9, 0.4], "size": [96, 72]}
CAMERA["channels"] = ["rgb", "depth", "segmentation"]
BALL = {"source": {"sphere": 0.1}, "mass": 1.0}
OBJECTS: dict[str, tuple[str, dict[str, Any]]] = {
    "rigid": ("a box", {"source": {"box": [0.1, 0.1, 0.1]}}),
    "articulation": ("a box with a lid", {"source": {"procedural": "hinge_box"}}),
    "rigid_instancer": ("20 balls", {"source": {"sphere": 0.02}, "family": "rigid_instancer", "count": 20}),
}
"""Objects, by what they are: their size in words, and their spec."""
MATTER: dict[str, tuple[str, dict[str, Any]]] = {
    "deformable": ("125 points", {"box": [0.1, 0.1, 0.1]}),
    "fem_cloth": ("100 points", {"size": [0.3, 0.3], "points": [10, 10], "position": [0.0, 0.0, 0.02]}),
    "garment": ("a towel, 169 points", {"towel": [0.3, 0.3], "position": [0.0, 0.0, 0.02]}),
    "fluid": ("500 particles", {"box": [0.1, 0.1, 0.05]}),
    "sand": ("about 200 grains", {"box": [0.06, 0.06, 0.06]}),
    "rice": ("about 200 balls", {"box": [0.03, 0.03, 0.02]}),
    "inflatable": ("42 points", {"radius": 0.1, "subdivisions": 1}),
    "rope": ("41 points", {"path": [[-0.25, 0.0, 0.0], [0.25, 0.0, 0.0]], "position": [0.0, 0.0, 0.3]}),
    "magnet": ("2 dipoles", {"dipoles": {"one": {"body": "ball", "moment": [0, 0, 2]}, "two": {"moment": [0, 0, 9]}}}),
    "fire": ("400 puffs", {}),
    "flow": ("250 puffs", {"speed": 1.0, "emission": 1e-3, "wind": [0.2, 0, 0], "drag": {"ball": {"area": 0.03}}}),
    "avatar": ("one person", {"do": ["talk"]}),
}
"""Families, likewise."""
NAMES = (
    *("rigid", "articulation", "rigid_instancer", "deformable", "fem_cloth", "garment", "fluid", "sand", "rice"),
    *("inflatable", "rope", "magnet", "fire", "flow", "avatar"),
)
BY_ENGINE = "rests on its engine's"


def run_of(name: str, engine: str) -> dict[str, Any]:
    """A run of the suite with this family, and a camera."""
    objects: dict[str, Any] = {"ball": BALL}
    layout: dict[str, Any] = {"ball": {"position": {"range": [[0.6, -0.2, 0.1], [0.7, 0.2, 0.1]]}}}
    families: dict[str, Any] = {}
    if name in OBJECTS:
        objects[fixtures.NAME], layout[fixtures.NAME] = OBJECTS[name][1], {"position": [0.0, 0.0, 0.06]}
    else:
        families[fixtures.NAME] = {"kind": name, **MATTER[name][1]}
    world = {"objects": objects, "layout": layout, "families": families, "cameras": {"eye": CAMERA}}
    task = {**WATCHING["task"], "horizon": 4 * STEPS}
    return {"engine": engine, "physics": {"dt": 0.004, "control_dt": 0.02}, "world": world, "task": task}


@contextmanager
def maker(run: dict[str, Any]) -> Iterator[Callable[..., anysim.TaskEnv]]:
    """Makes envs as the suite's fixture does."""
    made: dict[int, anysim.TaskEnv] = {}
    others = list[anysim.TaskEnv]()

    def one(num_envs: int, *, fresh: bool = False) -> anysim.TaskEnv:
        if fresh:
            others.append(anysim.make(run, num_envs=num_envs))
            return others[-1]
        if num_envs not in made:
            made[num_envs] = anysim.make(run, num_envs=num_envs)
        return made[num_envs]

    try:
        yield one
    finally:
        for env in (*made.values(), *others):
            env.close()


def suite(run: dict[str, Any], make: Callable[..., anysim.TaskEnv], folder: Path) -> dict[str, str]:
    """What each test of the suite says: `passed`, `skipped`, or what is wrong."""
    found = dict[str, str]()
    values = {"run_spec": run, "make": make, "tmp_path": folder}
    for name, test in inspect.getmembers(test_family, inspect.isfunction):
        if name.startswith("test_"):
            try:
                test(**{key: values[key] for key in inspect.signature(test).parameters})
                found[name] = "passed"
            except pytest.skip.Exception:
                found[name] = "skipped"
            except (AssertionError, anysim.errors.AnysimError) as error:
                found[name] = f"{type(error).__name__}: {error}".splitlines()[0]
    return found


def held(make: Callable[..., anysim.TaskEnv]) -> dict[str, str]:
    """The same questions of what an engine holds by itself."""
    env, rows = make(fixtures.ENVS), np.array([0])

    def steps(count: int, rows: Any = None) -> list[bytes]:
        found = list[bytes]()
        for _ in range(count):
            env.step(np.zeros((env.num_envs, env.action_dim)))
            state = env.engine.get_state()
            arrays = (state.body_pose, state.body_twist, state.joint_pos, state.joint_vel)
            found.append(b"".join(np.ascontiguousarray(a if rows is None else a[rows]).tobytes() for a in arrays))
        return found

    env.reset(seed=1)
    steps(4)
    snapshot = env.snapshot()
    expected = steps(STEPS)
    env.reset(seed=2)
    env.reset_to(snapshot)
    exact = steps(STEPS) == expected
    env.reset(seed=1)
    alone = steps(STEPS, rows)
    env.reset(seed=1)
    found = steps(4, rows)
    env.reset(mask=np.array([False, True, True]))
    found += steps(STEPS - 4, rows)
    words = {True: "passed", False: "differs"}
    return {"test_snapshot": words[exact], "test_partial_reset": words[found == alone]}


class Still:
    """A source of actions for the collector: none of them does anything, and no episode is given up."""

    name = "still"

    def __init__(self, env: anysim.TaskEnv) -> None:
        self._env = env

    def begin(self, env_ids: Any) -> None:
        """An episode begins."""

    def act(self, env_ids: Any) -> Any:
        """(N, A) zeros."""
        return np.zeros((self._env.num_envs, self._env.action_dim))

    def gave_up(self, env_ids: Any) -> Any:
        """(n,) none."""
        return np.zeros(len(env_ids), dtype=bool)

    def solved(self, env_ids: Any) -> Any:
        """(n,) none."""
        return np.zeros(len(env_ids), dtype=bool)

    def ended(self, env: int, success: bool) -> dict[str, Any]:
        """Nothing to tell."""
        return {}

    def describe(self, env: int) -> dict[str, Any]:
        """Nothing to tell."""
        return {}


def replays(run: dict[str, Any], folder: Path) -> bool:
    """Whether a recorded episode is the same once more, to the bit."""
    from anysim.record.replay import replay
    from anysim_recording.collector import Collector

    made = {**run, "record": {"keep": "all"}, "task": {**run["task"], "horizon": 6}}
    with anysim.make(made) as env:
        list(Collector(env, Still(env), folder, 1, seed=1).run())
    return all(replay(one).identical for one in (folder / "episodes").iterdir())


def pixels(make: Callable[..., anysim.TaskEnv]) -> int:
    """Of its entities in an image, after some steps."""
    env = make(1)
    env.reset(seed=1)
    for _ in range(STEPS):
        env.step(np.zeros((1, env.action_dim)))
    own = [i + 1 for i, entity in enumerate(env.engine.world.entities) if entity.category == fixtures.NAME]
    return int(np.isin(env.engine.render("eye", channels=("segmentation",))["segmentation"], own).sum())


def cost(make: Callable[..., anysim.TaskEnv], steps: int = 10, rounds: int = 5) -> float:
    """[ms] of processor time of a physics step of one env: in the quickest round, as others only make it slower."""
    env = make(1)
    action = np.zeros((1, env.action_dim))
    found: list[float] = []
    for _ in range(rounds):
        env.reset(seed=1)
        for _ in range(4):
            env.step(action)
        begun = time.process_time()
        for _ in range(steps):
            env.step(action)
        found.append(time.process_time() - begun)
    return min(found) / (5 * steps) * 1e3


def row(name: str, engine: str) -> dict[str, Any]:
    """What was found of a family on an engine."""
    size = (OBJECTS.get(name) or MATTER[name])[0]
    if name not in registry.names("families"):
        return {"size": size, "builds": "not installed"}
    run = run_of(name, engine)
    fixtures.STEPS = test_family.STEPS = STEPS
    fixtures.run.__defaults__ = (STEPS, None, None)
    try:
        with maker(run) as make, tempfile.TemporaryDirectory() as folder:
            make(1)
            tests = held(make) if name in OBJECTS else suite(run, make, Path(folder))
            wrong = {key: said for key, said in tests.items() if said not in ("passed", "skipped")}
            return {
                "size": size,
                "builds": "yes",
                "suite": BY_ENGINE if name in OBJECTS else wrong or f"{[*tests.values()].count('passed')} passed",
                "snapshot": tests["test_snapshot"] == "passed",
                "partial_reset": tests["test_partial_reset"] == "passed",
                "replay": replays(run, Path(folder) / "run"),
                "pixels": pixels(make),
                "ms": round(cost(make), 3),
            }
    except anysim.errors.AnysimError as error:
        return {"size": size, "builds": str(error).splitlines()[0]}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engine", default="mujoco,pybullet,sapien", help="engines, separated by commas")
    parser.add_argument("--families", default=",".join(NAMES), help="families, separated by commas")
    parser.add_argument("--write", action="store_true", help="replace rows of docs/families.json")
    asked = parser.parse_args()
    for engine in asked.engine.split(","):
        for name in asked.families.split(","):
            found = row(name, engine)
            print(engine, name, json.dumps(found), flush=True)
            if asked.write:
                rows = json.loads(ROWS.read_text("utf-8")) if ROWS.exists() else {}
                rows.setdefault(name, {})[engine] = found
                ordered = {key: dict(sorted(rows[key].items())) for key in NAMES if key in rows}
                ROWS.write_text(json.dumps(ordered, indent=1) + "\n", "utf-8")
