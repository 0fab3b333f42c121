"""Runs that are killed: a process that starts one run after the other by forking, so that none has to import anything.

It reads an order in each line of its input, as JSON, and answers with a line. The runs are those of a small task on the
kinematic engine, in worker processes where the order says so.
"""

import json
import os
import signal
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import anysim
from anysim_recording.collector import Collector
from anysim_sharded.engine import ShardedEngine, WorkerWarning
from tests.runtime import light

ENVS, EPISODES = 4, 48
SPEC = {**light.changed(light.BLOCKS_ONLY, task__horizon=10), "record": {"keep": "all"}}


class Order(NamedTuple):
    """A run into `out`, in `shards` worker processes (1: none).

    Attributes:
        victim: what is killed: `run`, `worker`, `both` or nothing.
        delay: when, from the moment on at which the run begins [s].
        between: with both, how long after its worker the run is killed [s].
        worker: which one.
    """

    out: str
    shards: int = 1
    victim: str = ""
    delay: float = 0.0
    between: float = 0.0
    worker: int = 0


class Still:
    """A policy that does nothing, for envs without actions."""

    def begin(self, env_ids: np.ndarray) -> None:
        """Nothing to prepare."""

    def act(self, env_ids: np.ndarray) -> np.ndarray:
        """No action, and some time to think."""
        time.sleep(0.003)
        return np.zeros((ENVS, 0))

    def gave_up(self, env_ids: np.ndarray) -> np.ndarray:
        """Never."""
        return np.zeros(len(env_ids), dtype=bool)

    def solved(self, env_ids: np.ndarray) -> np.ndarray:
        """Nothing to say."""
        return np.zeros(len(env_ids), dtype=bool)

    def ended(self, env: int, success: bool) -> dict[str, Any]:
        """Nothing to say."""
        del env, success
        return {}

    def describe(self, env: int) -> dict[str, Any]:
        """Nothing to say."""
        return {}


def run(order: Order, report: Path) -> None:
    """The run itself, in a process of its own. What came of it is in the file `report` at its end."""
    spec = {**SPEC, "engine": {"name": "null", "shards": order.shards}}
    with warnings.catch_warnings(record=True) as caught, anysim.make(spec, num_envs=ENVS) as env:
        warnings.simplefilter("always")
        collector = Collector(env, Still(), Path(order.out), EPISODES, seed=5)
        workers = env.engine.workers if isinstance(env.engine, ShardedEngine) else ()
        _write(report.with_suffix(".pids"), list(workers))
        began = time.monotonic()
        results = [
            {"env": r.env, "episode": r.episode, "reruns": r.reruns, "lost": r.lost, "resumed": r.resumed}
            for r in collector.run()
        ]
        said = sum(issubclass(one.category, WorkerWarning) for one in caught)
        took = time.monotonic() - began
    _write(report, {"results": results, "warnings": said, "seconds": took})


def serve() -> None:
    """Answer orders until the input ends."""
    with tempfile.TemporaryDirectory() as folder:  # what a first run imports and compiles, its children have then
        run(Order(f"{folder}/first"), Path(folder) / "first.report")
    for line in sys.stdin:
        order = Order(**json.loads(line))
        report = Path(order.out).with_suffix(".report")
        for file in (report, report.with_suffix(".pids")):
            file.unlink(missing_ok=True)
        child = os.fork()
        if child == 0:
            try:
                run(order, report)
            except BaseException:  # noqa: BLE001 - the parent is told
                _write(report, {"error": traceback.format_exc()})
            os._exit(0)
        status = os.waitstatus_to_exitcode(_waited(order, child, report.with_suffix(".pids")))
        answer = json.loads(report.read_text()) if report.exists() else {}
        print(json.dumps(answer | {"status": status}), flush=True)


def _waited(order: Order, child: int, pids: Path) -> int:
    if order.victim:
        while not pids.exists() and os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
            time.sleep(0.001)
        time.sleep(order.delay)
        if order.victim in ("worker", "both"):
            _kill(json.loads(pids.read_text())[order.worker])
            time.sleep(order.between)
        if order.victim in ("run", "both"):
            _kill(child)
    return os.waitpid(child, 0)[1]


def _kill(process: int) -> None:
    try:
        os.kill(process, signal.SIGKILL)
    except ProcessLookupError:
        return  # it had ended before


def _write(path: Path, value: Any) -> None:
    aside = path.with_suffix(".aside")
    aside.write_text(json.dumps(value))
    aside.replace(path)


if __name__ == "__main__":
    serve()
