"""The gallery of tasks in docs/tasks.md, from docs/tasks.json and the tasks themselves.

    python scripts/task_gallery.py [--check]
    python scripts/task_gallery.py --measure [TASK …]

`--measure` draws the picture of each task that has none, and evaluates a random policy and the expert where the task is
new or has changed; it takes minutes for a task, and goes on where it was cut off. The figures of the tasks of `core12`
are those of docs/benchmark.json. `--check` writes nothing and exits with 1 if the page has drifted.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from benchmark_table import STORE as BENCHMARK, table
from generated import ROOT, main
from PIL import Image

from anysim import registry
from anysim.api import load, task_path
from anysim.record.commit import write_whole
from anysim.task.snapshot import spec_hash

STORE = ROOT / "docs" / "tasks.json"
ENGINES = ("mujoco", "pybullet", "sapien")
POLICIES = ("random", "expert")
EPISODES, SPLIT = 16, "test"
WIDTH, HEIGHT = 300, 225
"""Of one engine's part of a picture [px]."""

ABOVE = "{from: [-0.35, -0.95, 1.45], look_at: [0.42, 0.0, 0.5], fov: 45.0}"
"""Where a cabinet's drawers are seen, which open towards the robot: the camera of the tasks is behind it."""

Figures = dict[str, Any]


def stored() -> Figures:
    """What was measured of each task."""
    return json.loads(STORE.read_text("utf-8")) if STORE.exists() else {}


def tasks() -> list[str]:
    """The tasks of anysim-tasks, family by family."""
    own = [name for name in registry.names("tasks") if registry.entry("tasks", name).value.startswith("anysim_tasks.")]
    return sorted(own, key=lambda name: (task_path(name).parent.parent.name, name))


def measure(only: list[str]) -> None:
    """Draw and evaluate what is new or has changed."""
    known = stored()
    benchmark: Figures = json.loads(BENCHMARK.read_text("utf-8"))
    for name in tasks():
        if only and name not in only:
            continue
        picture = task_path(name).with_name("picture.jpg")
        if not picture.exists():
            draw(name, picture)
        spec = spec_hash(load(name).spec)
        if known.get(name, {}).get("spec") == spec:
            continue
        sys.stderr.write(f"{name}: evaluating\n")
        rows = [row for row in benchmark["rows"] if row["task"] == name and row["policy"] in POLICIES]
        if benchmark["parts"].get(f"tasks.{name}.spec") != spec:
            rows = [
                row for policy in POLICIES if policy != "expert" or solvable(name) for row in evaluated(name, policy)
            ]
        known[name] = {"spec": spec, **{policy: {} for policy in POLICIES}}
        for row in rows:
            known[name][row["policy"]][row["engine"]] = [round(row["success"] * row["attempts"]), row["attempts"]]
        write_whole(STORE.parent, {STORE.name: json.dumps(known, indent=1, sort_keys=True) + "\n"})


def solvable(name: str) -> bool:
    """Whether a task has an expert, which hard ones may lack."""
    spec = load(name).spec
    return bool(spec.task and spec.task.expert) or bool(spec.collect and spec.collect.commands)


def evaluated(name: str, policy: str) -> list[Figures]:
    """What `anysim evaluate` says of a policy on each engine."""
    with tempfile.TemporaryDirectory() as folder:
        words = ["evaluate", name, "--policy", policy, "--engine", "all", "--split", SPLIT, "--out", folder]
        _anysim(*words, "--episodes", str(EPISODES))
        told: Figures = json.loads((Path(folder) / "evaluation.json").read_text("utf-8"))
    return [
        {"policy": policy, "engine": engine, "success": found["success_rate"], "attempts": found["attempts"]}
        for engine, found in told["engines"].items()
    ]


def draw(name: str, path: Path) -> None:
    """One start of a task as MuJoCo, PyBullet and SAPIEN draw it, side by side."""
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "whole.png"
        words = ["picture", name, "--engines", ",".join(ENGINES), "-n", "1", "--seed", "1"]
        on_table = {"cabinet", "table"} <= set(load(name).spec.world.objects)
        view = ["-o", f"world.cameras.front={ABOVE}"] if on_table else []
        _anysim(*words, *view, "--size", str(WIDTH), str(HEIGHT), "--out", str(whole))
        Image.open(whole).convert("RGB").save(path, quality=75, optimize=True)


def _anysim(*words: str) -> None:
    subprocess.run([str(Path(sys.executable).with_name("anysim")), *words], check=True, stdout=subprocess.DEVNULL)


def page() -> str:
    """A table of all tasks, then each with its picture."""
    known = stored()
    columns = ("task", "robots", "steps", "levels", "expert", "solved by it on MuJoCo, PyBullet, SAPIEN", "by chance")
    rows: list[list[str]] = []
    parts: list[str] = []
    family = ""
    for name in tasks():
        spec = load(name).spec
        task, folder = spec.task, task_path(name).parent.relative_to(ROOT)
        assert task is not None
        commands = spec.collect.commands if spec.collect else ()
        expert = f"`{task.expert.skill}`" if task.expert else f"{len(commands)} commands" if commands else "none"
        robots = ", ".join(dict.fromkeys(one.robot for one in spec.world.robots.values()))
        solved = [_rates(known.get(name, {}).get(policy, {})) for policy in ("expert", "random")]
        rows.append([f"[`{name}`](#{name})", robots, str(task.horizon), " ".join(spec.levels), expert, *solved])
        if folder.parent.name != family:
            family = folder.parent.name
            parts.append(f"## {family.replace('_', ' ')}")
        link = f"[sizes, resets and thresholds](../{folder}/README.md)"
        parts.append(
            f"### {name}\n\n{task.description} {link}\n\n![{name}, drawn by three engines](../{folder}/picture.jpg)"
        )
    return "\n\n".join([table(columns, rows), *parts])


def _rates(found: dict[str, list[int]]) -> str:
    counts = [found.get(engine) for engine in ENGINES]
    return " / ".join("-" if count is None else f"{count[0]} of {count[1]}" for count in counts)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--measure"]:
        measure(sys.argv[2:])
        sys.argv[1:] = []
    sys.exit(main(__doc__, "tasks", "task_gallery.py", ["docs/tasks.md"], page))
