"""Runs of the contract suites in processes of their own, for the tests of the suites."""

import json
import os
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

from tests import forked

HERE = Path(__file__).parent


def run(*words: str, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    """`python words` in a folder, with the tests importable."""
    paths = [str(HERE.parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    return forked.run(*words, cwd=folder, env=environment)


def outcomes_of(suite: str, module: str, jobs: Mapping[str, Sequence[str]], folder: Path) -> dict[str, dict[str, str]]:
    """How tests of a suite end, by class of a module: all of them in one process."""
    named = {f"{module}:{name}": list(tests) for name, tests in jobs.items()}
    (folder / "jobs.json").write_text(json.dumps(named))
    files = (str(folder / "jobs.json"), str(folder / "results.json"))
    done = run(str(HERE / "run_engines.py"), *files, suite, folder=folder)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr
    found = json.loads((folder / "results.json").read_text())
    return {name.rpartition(":")[2]: tests for name, tests in found.items()}
