"""The gallery of tasks in docs/tasks.md, from docs/tasks.json and the tasks themselves.

    python scripts/task_gallery.py [--check]
    python scripts/task_gallery.py --measure [--episodes N] [TASK …]

`--measure` draws the picture of each task that has none. Where a task is new or has changed it evaluates its expert, or
the learned policy that comes with it where it has none, and a random policy: one on one engine at a time, short tasks
first. It takes minutes for each, and goes on where it was cut off: finished ones are in docs/tasks.json, the episodes
of the one at hand in runs/gallery. Where an episode takes a minute, `--episodes` asks for fewer; more can be added
later. Figures of the tasks of `core12` are those of docs/benchmark.json where these have as many episodes. `--check`
writes nothing and exits with 1 if the page has drifted, or if an expert or such a policy solves less than the
difficulty of its task promises.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from benchmark_table import STORE as BENCHMARK, table
from generated import ROOT, main
from PIL import Image

from anysim import registry
from anysim.api import load, task_path
from anysim.math.statistics import wilson
from anysim.record.commit import write_whole
from anysim.task.snapshot import spec_hash
from anysim_schemas.run import RunSpec

STORE = ROOT / "docs" / "tasks.json"
RUNS = ROOT / "runs" / "gallery"
ENGINES = ("mujoco", "pybullet", "sapien")
EPISODES = {"expert": 50, "shipped": 50, "random": 16}
"""Of each task on each engine."""
SPLIT = "test"
PROMISED = {"easy": (0.9, 0.8, 0.8), "medium": (0.7, 0.6, 0.6), "hard": (0.0, 0.0, 0.0)}
"""The least success of an expert on each engine, by the difficulty of its task."""
WIDTH, HEIGHT = 300, 225
"""Of one engine's part of a picture [px]."""

ABOVE = "{from: [-0.35, -0.95, 1.45], look_at: [0.42, 0.0, 0.5], fov: 45.0}"
"""Where a cabinet's drawers are seen, which open towards the robot: the camera of the tasks is behind it."""

Figures = dict[str, Any]


class Cell(NamedTuple):
    """A policy of a task on an engine."""

    task: str
    policy: str
    engine: str


def stored() -> Figures:
    """What was measured of each task: of each policy and engine the number of successes, of attempts and of faults."""
    return json.loads(STORE.read_text("utf-8")) if STORE.exists() else {}


def tasks() -> list[str]:
    """The tasks of anysim-tasks, family by family."""
    own = [name for name in registry.names("tasks") if registry.entry("tasks", name).value.startswith("anysim_tasks.")]
    return sorted(own, key=lambda name: (task_path(name).parent.parent.name, name))


def difficulty(name: str) -> str:
    """How hard a task is for a scripted policy, as its page says."""
    page = task_path(name).with_name("README.md")
    said = re.search(r"^\| difficulty \| (\w+)", page.read_text("utf-8"), re.MULTILINE)
    if said is None or said[1] not in PROMISED:
        raise SystemExit(f"{page}: expected a row '| difficulty | … |' with one of {', '.join(PROMISED)}")
    return said[1]


def measure(words: list[str]) -> None:
    """Draw and evaluate what is new or has changed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=max(EPISODES.values()), help="at most, of each policy")
    parser.add_argument("tasks", nargs="*", help="all of them if not given")
    asked = parser.parse_args(words)
    only, known = asked.tasks, stored()
    episodes = {policy: min(count, asked.episodes) for policy, count in EPISODES.items()}
    specs = {name: spec_hash(load(name).spec) for name in only or tasks()}
    for name in specs:
        picture = task_path(name).with_name("picture.jpg")
        if not picture.exists():
            draw(name, picture)
    left = [
        cell for cell in cells(list(specs)) if not _enough(known.get(cell.task, {}), cell, specs[cell.task], episodes)
    ]
    for number, cell in enumerate(left, 1):
        sys.stderr.write(f"{number} of {len(left)}: {' '.join(cell)}\n")
        figures: Figures = known.get(cell.task, {})
        if figures.get("spec") != specs[cell.task]:
            figures = {"spec": specs[cell.task]}
        found = _benchmarked(cell, specs[cell.task]) or evaluated(cell, specs[cell.task], episodes[cell.policy])
        figures.setdefault(cell.policy, {})[cell.engine] = found
        known = stored() | {cell.task: figures}
        write_whole(STORE.parent, {STORE.name: json.dumps(known, indent=1, sort_keys=True) + "\n"})


def cells(names: list[str]) -> Iterator[Cell]:
    """What is to be measured of tasks, the shortest first."""
    specs = {name: load(name).spec for name in names}
    for name, spec in sorted(specs.items(), key=lambda entry: entry[1].task.horizon if entry[1].task else 0):
        policies = [policy for policy in (solver(spec), "random") if policy is not None]
        yield from (Cell(name, policy, engine) for engine in ENGINES for policy in policies)


def solver(spec: RunSpec) -> str | None:
    """The policy that solves a task: its expert, else the learned one that comes with it, if there is either."""
    if (spec.task and spec.task.expert) or (spec.collect and spec.collect.commands):
        return "expert"
    return "shipped" if spec.task and spec.task.shipped else None


def _enough(figures: Figures, cell: Cell, spec: str, episodes: dict[str, int]) -> bool:
    _, attempts, faults = figures.get(cell.policy, {}).get(cell.engine, (0, 0, 0))
    return figures.get("spec") == spec and attempts + faults >= episodes[cell.policy]


def _benchmarked(cell: Cell, spec: str) -> list[int] | None:
    """What the benchmark says of it, if it is the same task and has as many episodes."""
    told: Figures = json.loads(BENCHMARK.read_text("utf-8"))
    if told["parts"].get(f"tasks.{cell.task}.spec") != spec or told["episodes"] < EPISODES[cell.policy]:
        return None
    for row in told["rows"]:
        if (row["task"], row["policy"], row["engine"]) == cell:
            return [round(row["success"] * row["attempts"]), row["attempts"], row["faults"]]
    return None


def evaluated(cell: Cell, spec: str, count: int) -> list[int]:
    """What `anysim evaluate` says of it."""
    folder = RUNS / cell.task / spec[:12] / cell.policy
    words = ["evaluate", cell.task, "--policy", cell.policy, "--engine", cell.engine, "--split", SPLIT]
    run_anysim(*words, "--episodes", str(count), "--out", str(folder))
    told: Figures = json.loads((folder / "evaluation.json").read_text("utf-8"))
    found = told["engines"][cell.engine]
    return [found["successes"], found["attempts"], found["faults"]]


def draw(name: str, path: Path) -> None:
    """One start of a task as MuJoCo, PyBullet and SAPIEN draw it, side by side."""
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "whole.png"
        words = ["picture", name, "--engines", ",".join(ENGINES), "-n", "1", "--seed", "1"]
        on_table = {"cabinet", "table"} <= set(load(name).spec.world.objects)
        view = ["-o", f"world.cameras.front={ABOVE}"] if on_table else []
        run_anysim(*words, *view, "--size", str(WIDTH), str(HEIGHT), "--out", str(whole))
        Image.open(whole).convert("RGB").save(path, quality=75, optimize=True)


def run_anysim(*words: str) -> None:
    """A command of anysim, quietly."""
    subprocess.run([str(Path(sys.executable).with_name("anysim")), *words], check=True, stdout=subprocess.DEVNULL)


def page() -> str:
    """A table of all tasks, then each with its picture."""
    known = stored()
    columns = ("task", "difficulty", "robots", "steps", "expert", "MuJoCo", "PyBullet", "SAPIEN", "by chance")
    rows: list[list[str]] = []
    parts: list[str] = []
    family = ""
    for name in tasks():
        spec = load(name).spec
        task, folder = spec.task, task_path(name).parent.relative_to(ROOT)
        assert task is not None
        commands = spec.collect.commands if spec.collect else ()
        told = f"{len(commands)} commands" if commands else "learned" if task.shipped else "none"
        expert = f"`{task.expert.skill}`" if task.expert else told
        robots = ", ".join(dict.fromkeys(one.robot for one in spec.world.robots.values()))
        figures = known.get(name, {})
        solved = [rate(figures.get(solver(spec) or "expert", {}).get(engine)) for engine in ENGINES]
        chance = _chance(figures.get("random", {}))
        rows.append([f"[`{name}`](#{name})", difficulty(name), robots, str(task.horizon), expert, *solved, chance])
        if folder.parent.name != family:
            family = folder.parent.name
            parts.append(f"## {family.replace('_', ' ')}")
        link = f"[sizes, resets and thresholds](../{folder}/README.md)"
        parts.append(
            f"### {name}\n\n{task.description} {link}\n\n![{name}, drawn by three engines](../{folder}/picture.jpg)"
        )
    return "\n\n".join([table(columns, rows), *parts])


def rate(found: list[int] | None) -> str:
    """A count with Wilson's interval in percent."""
    if found is None:
        return "-"
    won, attempts, faults = found
    low, high = wilson(won, attempts)
    return f"{won} of {attempts} ({100 * low:.0f} to {100 * high:.0f})" + (f", {faults} faults" if faults else "")


def _chance(found: dict[str, list[int]]) -> str:
    if len({found[engine][1] for engine in found}) != 1:
        return " / ".join(rate(found.get(engine)) for engine in ENGINES)
    counts = (str(found[engine][0]) if engine in found else "-" for engine in ENGINES)
    return f"{' / '.join(counts)} of {next(iter(found.values()))[1]}"


def broken_promises() -> Iterator[str]:
    """The experts that solve less than the difficulty of their task promises."""
    for name, figures in stored().items():
        for engine, least in zip(ENGINES, PROMISED[difficulty(name)], strict=True):
            who = "expert" if figures.get("expert") else "shipped"
            won, attempts, _ = figures.get(who, {}).get(engine, (0, 0, 0))
            if attempts and won < least * attempts:
                words = f"`--policy {who}` solves {won} of {attempts} on {engine}, not {least:.0%}"
                yield f"{name} is {difficulty(name)}, and {words}"


if __name__ == "__main__":
    if sys.argv[1:2] == ["--measure"]:
        measure(sys.argv[2:])
        sys.argv[1:] = []
    code = main(__doc__, "tasks", "task_gallery.py", ["docs/tasks.md"], page)
    broken = list(broken_promises())
    sys.stderr.writelines(f"{line}\n" for line in broken)
    sys.exit(code or bool(broken))
