"""Planners that break in one env of several: its episode fails with its type, the others go on, nothing is left."""

import threading
import time
from pathlib import Path

import numpy as np
import pytest

from anysim import make
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_engine
from anysim_planning import queued
from anysim_planning.processes import ProcessService
from anysim_planning.threads import ThreadedService
from anysim_recording.collector import Collector, EpisodeResult
from anysim_skills import planned_moves, planning
from tests.plugins.sharded.shards_help import children
from tests.plugins.skills.faulty_planners import BEYOND, FAULT, WALL, faulty

ENVS = 3
SERVICES = {"threads": ThreadedService, "processes": ProcessService}
CASES = [
    ("raises", "threads", "no_path"),
    *(
        pytest.param(*case, marks=pytest.mark.slow)
        for case in (
            ("raises", "processes", "no_path"),
            ("dies", "processes", "no_path"),
            ("hangs", "threads", "timeout"),
            ("hangs", "processes", "timeout"),
            ("is slow", "threads", "ok"),
            ("is slow", "processes", "ok"),
        )
    ),
]


def collected(out: Path, monkeypatch: pytest.MonkeyPatch, fault: str, service: str) -> tuple[int, list[EpisodeResult]]:
    """The env that the fault hits, and an episode of each env at the default latency."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[3]))  # processes import the planner
    monkeypatch.setenv(FAULT, fault)
    monkeypatch.setattr(planning, "planner_service", lambda world, name, workers: SERVICES[service](world, faulty, 2))
    with make(WALL, engine="mujoco", num_envs=ENVS) as env:
        env.reset(seed=5)
        cube = env.scene.state.body_pose[:, env.engine.index.body("cube"), 1]
        hit, last = np.argsort(cube)[[-1, -2]].tolist()
        monkeypatch.setenv(BEYOND, repr(float(cube[[hit, last]].mean())))
        policy = SkillPolicy(env)
        results = list(Collector(env, policy, out, ENVS, seed=5).run())
        (plans,) = policy.planners
        assert plans.counts.queue == 0
        assert plans.counts.late > 0
        assert (plans.counts.lost_workers > 0) == (fault in ("hangs", "dies"))
    return hit, sorted(results, key=lambda result: result.env)


@pytest.mark.parametrize(("fault", "service", "outcome"), CASES)
def test_an_episode_fails_with_its_type_and_the_others_go_on(
    fault: str, service: str, outcome: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    require_engine("mujoco")
    if fault == "hangs":
        monkeypatch.setattr(planned_moves, "DEADLINE", 1.5)
        monkeypatch.setattr(queued, "GRACE", 0.1)
    threads, processes = threading.active_count(), children()
    hit, results = collected(tmp_path / "faulty", monkeypatch, fault, service)
    for result in results:
        good = result.env != hit or outcome == "ok"
        assert result.status == ("success" if good else "failed"), result
        assert good or result.outcome["outcome"] == outcome
        assert (result.path is not None) == good
    end = time.perf_counter() + 10.0  # a thread that hangs in a planner ends when that returns
    while threading.active_count() > threads and time.perf_counter() < end:
        time.sleep(0.01)
    assert (threading.active_count(), children()) == (threads, processes)
    _, calm = collected(tmp_path / "calm", monkeypatch, "", service)
    same = [(a.steps, a.outcome) == (b.steps, b.outcome) for a, b in zip(results, calm, strict=True)]
    assert [env for env in range(ENVS) if not same[env]] == ([] if outcome == "ok" else [hit])
