"""Recordings of tasks with people and matter: what their families tell, a file can hold."""

import pytest

import anysim
from anysim import registry
from anysim.api import load
from anysim.record.manifest import read_manifest
from anysim.skills.runner import SkillPolicy
from anysim_inspect.verify import verify
from anysim_recording.collector import Collector

pytestmark = pytest.mark.slow


def test_each_task_with_people_or_matter_is_recorded(tmp_path) -> None:
    tried = []
    for task in registry.names("tasks"):
        if not load(task).spec.world.families:
            continue
        with anysim.make(task, num_envs=1, overrides=["record.keep=all", "task.horizon=2"]) as env:
            (result,) = Collector(env, SkillPolicy(env), tmp_path / task, 1, 1).run()
        assert result.path is not None
        assert not verify(result.path), task
        assert any(name.startswith("family") for name in read_manifest(result.path).layout.state), task
        tried.append(task)
    assert len(tried) > 10
