"""Episodes whose worker process is lost: they did not fail, and are begun anew, to come out as they would have."""

import os
import signal
import warnings
from pathlib import Path

import pytest

import anysim
from anysim.conventions import Array
from anysim.record.reader import open_trajectory
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim_recording.collector import RERUNS, Collector, EpisodeResult
from anysim_sharded.engine import ShardedEngine, WorkerWarning
from tests.task.helpers import BLIND

SHARDED = [*BLIND, "record.keep=all", "task.horizon=6", "engine.shards=2"]


class Killing(SkillPolicy):
    """Kills the worker of env 0 after some of its control steps, counted from 1 over all episodes."""

    def __init__(self, env: TaskEnv, after: range) -> None:
        super().__init__(env)
        self.after, self.count = after, 0

    def act(self, env_ids: Array) -> Array:
        self.count += 1
        if self.count in self.after:
            assert isinstance(self.env.engine, ShardedEngine)
            os.kill(self.env.engine.workers[0], signal.SIGKILL)
        return super().act(env_ids)


def collected(out: Path, killed: range = range(0)) -> dict[tuple[int, int], EpisodeResult]:
    with anysim.make("pick_cube", engine="null", num_envs=2, overrides=SHARDED) as env:
        collector = Collector(env, Killing(env, killed), out, 6, seed=4)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", WorkerWarning)
            results = list(collector.run())
    found = {(r.env, r.episode): r for r in results}
    assert len(found) == len(results) == 6
    return found


def test_they_are_begun_anew_and_come_out_as_if_nothing_had_been(tmp_path: Path) -> None:
    whole, disturbed = collected(tmp_path / "whole"), collected(tmp_path / "disturbed", range(4, 5))
    assert sum(r.reruns for r in whole.values()) == 0
    assert {key: r.reruns for key, r in disturbed.items() if r.reruns} == {(0, 0): 1}
    for key, one in disturbed.items():
        assert not one.lost
        assert (one.status, one.steps, one.episode_seed) == (
            whole[key].status,
            whole[key].steps,
            whole[key].episode_seed,
        )
        assert one.total_reward == whole[key].total_reward
        assert one.path is not None
        ours, theirs = (open_trajectory(r.path).manifest for r in (one, whole[key]) if r.path is not None)
        assert ours.final_digest == theirs.final_digest


def test_one_that_loses_every_worker_is_given_up_and_is_no_failure(tmp_path: Path) -> None:
    found = collected(tmp_path, range(1, RERUNS + 2))
    lost = {key: r.reruns for key, r in found.items() if r.lost}
    assert lost == {(0, 0): RERUNS}
    assert all(r.path is not None for key, r in found.items() if key not in lost)


@pytest.mark.parametrize("envs", [1, 2])
def test_engines_without_workers_lose_nothing(envs: int) -> None:
    with anysim.make("pick_cube", engine="null", num_envs=envs, overrides=BLIND) as env:
        assert env.engine.lost.tolist() == [False] * envs
