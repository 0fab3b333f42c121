"""Seconds from nothing to `anysim --help`, and to the first control step of `anysim run`, each in new processes.

    python benchmarks/startup.py [--rounds 7] [--engine mujoco] [--task pick_cube]

The best of several counts: the first of them prepares the caches. `cpu s` is what all threads of a process take, which
other work on the machine changes least; it alone is judged: exit 1 where it is over its limit.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

HELP_LIMIT, STEP_LIMIT = 0.2, 1.6
"""Seconds of an idle machine."""

UNTIL_A_STEP = """
import os, sys
from anysim import hooks
from anysim.cli.main import main

class Stop:
    @hooks.hookimpl
    def after_step(self):
        os._exit(0)  # what a run does at its end is no start

hooks.manager().register(Stop())
try:
    main()
finally:  # it has ended without a step
    sys.stdout.flush()
    os._exit(3)
"""


class Seconds(NamedTuple):
    """Of one process, from its start to its end."""

    wall: float
    cpu: float


def measured(words: list[str], folder: Path) -> Seconds:
    """Run a program in a folder; one that fails ends this one with what it said."""
    with (folder / "said.txt").open("w+b") as said:
        start = time.perf_counter()
        process = subprocess.Popen(words, cwd=folder, stdout=said, stderr=said)
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - start
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            said.seek(0)
            sys.exit(f"{' '.join(words[-8:])}: exit code {process.returncode}\n{said.read().decode()}")
    return Seconds(wall, usage.ru_utime + usage.ru_stime)


def main() -> int:
    """Measure, print a table, and judge."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--engine", default="mujoco")
    parser.add_argument("--task", default="pick_cube")
    asked = parser.parse_args()
    step = [sys.executable, "-c", UNTIL_A_STEP, "run", asked.task, "--engine", asked.engine, "--episodes", "1"]
    rows = {
        "anysim --help": ([str(Path(sys.executable).with_name("anysim")), "--help"], HELP_LIMIT),
        f"anysim run {asked.task}, first step": (step, STEP_LIMIT),
    }
    missed = 0
    print(f"{'':34}{'cpu s':>8}{'wall s':>8}{'limit s':>9}")
    for name, (words, limit) in rows.items():
        with tempfile.TemporaryDirectory() as folder:
            found = [measured(words, Path(folder)) for _ in range(asked.rounds)]
        cpu, wall = min(one.cpu for one in found), min(one.wall for one in found)
        print(f"{name:34}{cpu:8.2f}{wall:8.2f}{limit:9.1f}{'  missed' * (cpu > limit)}", flush=True)
        missed += cpu > limit
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
