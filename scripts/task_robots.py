"""The table of tasks with other robots in docs/tasks.md, from docs/task_robots.json and the tasks' `alternates`.

    python scripts/task_robots.py [--check]
    python scripts/task_robots.py --measure [TASK …]

`--measure` evaluates the expert with each alternate that is new or has changed, one at a time, short tasks first: on
MuJoCo, and those of `EVERYWHERE` on all engines. It goes on where it was cut off: finished ones are in the JSON file,
the episodes of the one at hand in runs/robots. Alternates whose files are not installed keep what was measured
elsewhere. `--check` writes nothing and exits with 1 if the page has drifted.
"""

import json
import sys
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from benchmark_table import table
from generated import ROOT, main
from task_gallery import ENGINES, SPLIT, rate, run_anysim, tasks

from anysim.api import load
from anysim.assets.catalogue import load_robot, missing_source
from anysim.record.commit import write_whole
from anysim.task.snapshot import spec_hash

STORE = ROOT / "docs" / "task_robots.json"
RUNS = ROOT / "runs" / "robots"
EPISODES = 16
EVERYWHERE = {
    "pick_cube": ("ur5_gripper", "xarm7_gripper"),
    "stack_cube": ("ur5_gripper", "xarm7_gripper"),
    "go1_velocity": ("unitree_go2", "anymal_c", "solo12", "unitree_b1"),
}
"""Measured on all engines; the others on the first one."""

Figures = dict[str, dict[str, dict[str, Any]]]
"""By task and robot: the hash of its spec, and of each engine the number of successes, of attempts and of faults."""


class Cell(NamedTuple):
    """A task with an alternate on an engine, and the hash of what that is."""

    task: str
    robot: str
    engine: str
    spec: str


def stored() -> Figures:
    """What was measured."""
    return json.loads(STORE.read_text("utf-8")) if STORE.exists() else {}


def measure(only: list[str]) -> None:
    """Evaluate what is new or has changed."""
    known = stored()
    left = [cell for cell in cells(only or tasks()) if not _enough(known, cell)]
    for number, cell in enumerate(left, 1):
        sys.stderr.write(f"{number} of {len(left)}: {' '.join(cell[:3])}\n")
        of_task = known.setdefault(cell.task, {})
        if of_task.get(cell.robot, {}).get("spec") != cell.spec:
            of_task[cell.robot] = {"spec": cell.spec}
        of_task[cell.robot][cell.engine] = evaluated(cell)
        write_whole(STORE.parent, {STORE.name: json.dumps(known, indent=1, sort_keys=True) + "\n"})


def cells(names: list[str]) -> Iterator[Cell]:
    """What is to be measured of tasks, the shortest first."""
    specs = {name: load(name).spec for name in names}
    for name, spec in sorted(specs.items(), key=lambda entry: entry[1].task.horizon if entry[1].task else 0):
        for robot in spec.alternates:
            if not missing_source(load_robot(robot)):
                found = spec_hash(load(name, overrides=[f"robot={robot}"]).spec)
                engines = ENGINES if robot in EVERYWHERE.get(name, ()) else ENGINES[:1]
                yield from (Cell(name, robot, engine, found) for engine in engines)


def _enough(known: Figures, cell: Cell) -> bool:
    figures = known.get(cell.task, {}).get(cell.robot, {})
    _, attempts, faults = figures.get(cell.engine, (0, 0, 0))
    return figures.get("spec") == cell.spec and attempts + faults >= EPISODES


def evaluated(cell: Cell) -> list[int]:
    """What `anysim evaluate` says of the expert."""
    folder = RUNS / cell.task / cell.robot / cell.spec[:12]
    words = ["evaluate", cell.task, "--robot", cell.robot, "--engine", cell.engine, "--split", SPLIT]
    run_anysim(*words, "--episodes", str(EPISODES), "--out", str(folder))
    found = json.loads((folder / "evaluation.json").read_text("utf-8"))["engines"][cell.engine]
    return [found["successes"], found["attempts"], found["faults"]]


def page() -> str:
    """A table of the tasks' alternates."""
    known = stored()
    columns = ("task", "robot", "beside it changes", "MuJoCo", "PyBullet", "SAPIEN")
    rows: list[list[str]] = []
    for name in tasks():
        spec = load(name).spec
        for robot in spec.alternates:
            figures = known.get(name, {}).get(robot, {})
            changed = ", ".join(_changes(spec.to_dict(), load(name, overrides=[f"robot={robot}"]).spec.to_dict()))
            rates = [rate(figures.get(engine)) for engine in ENGINES]
            rows.append([f"[`{name}`](#{name})", f"`{robot}`", changed or "nothing", *rates])
    return table(columns, rows)


def _changes(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    """The sections of the file that an alternate changes beside the robot's name and the joints of the old one's."""
    found: list[str] = []
    for part in ("physics", "world", "task", "record"):
        one, other = old[part] or {}, new[part] or {}
        found += [key for key in one.keys() | other.keys() if key != "robots" and one.get(key) != other.get(key)]
    for name, robot in new["world"]["robots"].items():
        before: Mapping[str, Any] = old["world"]["robots"][name]
        found += [key for key, value in robot.items() if value and key != "robot" and value != before[key]]
    return sorted(set(found))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--measure"]:
        measure(sys.argv[2:])
        sys.argv[1:] = []
    sys.exit(main(__doc__, "robots", "task_robots.py", ["docs/tasks.md"], page))
