"""A recorded step as a WorldState: what is written into an engine is what was recorded."""

import numpy as np
import pytest

import anysim
from anysim.errors import RecordError
from anysim.record.reader import open_trajectory, world_state
from anysim.skills.runner import SkillPolicy
from anysim_recording.collector import Collector
from tests.task.helpers import BLIND


def test_any_step_of_a_recording_can_be_gone_on_from(tmp_path) -> None:
    overrides = [*BLIND, "record.keep=all", "task.horizon=6"]
    with anysim.make("pick_cube", engine="null", overrides=overrides) as env:
        [result] = Collector(env, SkillPolicy(env), tmp_path / "run", 1, 1).run()
        reader = open_trajectory(result.path)
        for step in (0, 4):
            state = world_state(reader, step)
            env.engine.set_world_state(state)
            rows = reader.initial_state if step == 0 else {n: r[step - 1] for n, r in reader.states.items()}
            now = env.engine.get_state()
            assert np.allclose(now.body_pose[0], rows["body_pose"], atol=1e-9)
            assert np.allclose(now.joint_pos[0], rows["joint_pos"], atol=1e-9)
            assert np.allclose(env.engine.control.position[0], rows["control_position"])
            assert now.time[0] == pytest.approx(0.02 * step)
        with pytest.raises(RecordError, match="has the steps 0 to 6, not 7"):
            world_state(reader, 7)
