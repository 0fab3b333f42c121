"""Costs of the tasks' episodes in the costs.json of each, by which `anysim run --balance` shares episodes out.

    python scripts/task_costs.py [TASK …] [--engines mujoco,pybullet,sapien]

Collects with the expert of each task where it is new or has changed, one engine at a time, without cameras, and goes on
where it was cut off. Nothing checks that the files are fresh: they are measurements, and their ratios are what counts.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from task_gallery import ENGINES, tasks

from anysim.api import load, task_path
from anysim.record.commit import write_whole
from anysim.task.snapshot import spec_hash
from anysim_collect.balance import COSTS_FILE, Cost, TaskCosts, costs_of
from anysim_collect.report import read_report

EPISODES, ENVS, SEED = 16, 8, 31


def measured(task: str, engine: str) -> Cost:
    """Collect in a process of its own."""
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-m", "anysim.cli", "run", task, "--engine", engine, "--json", "--out", out]
        command += ["--episodes", str(EPISODES), "--num-envs", str(ENVS), "--seed", str(SEED)]
        command += ["-o", "record.cameras=[]", "-o", "engine.shards=1"]  # the time of other processes is not counted
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise SystemExit(f"{task} on {engine}: {done.stderr.strip()}")
        told = read_report(Path(out))
    planning = told["planning"].get("CPU [s]", 0.0)
    seconds = float(f"{told['cpu_s'] + planning:.3g}")
    return Cost(episodes=told["attempts"], segments=told["segments"], cpu_s=seconds)


def measure(task: str, engines: list[str]) -> None:
    """Measure what is not known of a task, engine by engine."""
    spec, folder = spec_hash(load(task).spec), task_path(task).parent
    stored = folder / COSTS_FILE
    fresh = stored.exists() and json.loads(stored.read_text("utf-8"))["spec"] == spec
    known = costs_of(task) if fresh else {}
    for engine in engines:
        if engine not in known:
            known[engine] = measured(task, engine)
            print(task, engine, known[engine], flush=True)
            write_whole(folder, {COSTS_FILE: _text(TaskCosts(spec=spec, engines=known))})


def _text(costs: TaskCosts) -> str:
    """JSON with a line for each engine."""
    rows = [f'  "{name}": {json.dumps(costs.engines[name].model_dump())}' for name in sorted(costs.engines)]
    return f'{{\n "spec": "{costs.spec}",\n "engines": {{\n' + ",\n".join(rows) + "\n }\n}\n"


def main() -> None:
    """Measure what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tasks", nargs="*", help="all if not given")
    parser.add_argument("--engines", default=",".join(ENGINES), help="separated by commas")
    chosen = parser.parse_args()
    for task in chosen.tasks or tasks():
        measure(task, chosen.engines.split(","))


if __name__ == "__main__":
    main()
