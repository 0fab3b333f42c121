"""Trainings that begin with what others have learnt. `make test-learning` runs this."""

from pathlib import Path
from typing import Any

import pytest

import anysim
from anysim.errors import TaskError

torch = pytest.importorskip("torch", reason="the learners need torch: make test-learning")
pytestmark = pytest.mark.full

QUIET = ["record.cameras=[]"]


def test_a_training_begins_with_what_another_has_learnt_from_less(tmp_path: Path) -> None:
    from anysim_learning import checkpoint
    from anysim_learning.adopt import begin_with
    from anysim_learning.export import described, export
    from anysim_learning.learner import Lesson
    from anysim_learning.rsl import RslPpo

    more = "task.observations.policy=[joint_pos, joint_vel, {term: last_action}, {term: base_pose, robot: panda}]"
    less = more.replace(", {term: base_pose, robot: panda}", "")

    def made(env: Any, **options: Any) -> tuple[Any, Any]:
        lesson = Lesson(env, ("policy",), 0)
        return RslPpo(lesson, n_steps=8, width=16, **options), lesson

    with anysim.make("reach", engine="mujoco", num_envs=4, overrides=[*QUIET, less]) as env:
        before, lesson = made(env)
        for _ in range(3):
            before.advance()
        export(before.network(), described(env, lesson.groups), tmp_path / "policy.onnx")
        checkpoint.save(tmp_path / "checkpoint.npz", before.state())
        sizes, small = env.observation_sizes["policy"], before.network().eval()
    with anysim.make("reach", engine="mujoco", num_envs=3, overrides=[*QUIET, more]) as env:  # of as many as it likes
        after, lesson = made(env, noise=0.1)
        begin_with(after, lesson, tmp_path)
        obs = torch.from_numpy(env.reset(seed=1)[0]["policy"])
        with torch.inference_mode():
            given = after.network().eval()(obs)
            assert torch.equal(given, small(obs[:, :sizes]))
        assert after.steps == 0
        noise = after.advance()["noise"]
        assert 0.08 < noise < 0.12
        with pytest.raises(TaskError, match=r"give the same options, such as `--option width=…`"):
            begin_with(RslPpo(lesson, n_steps=8, width=32), lesson, tmp_path)
        with pytest.raises(TaskError, match=r"has no policy.onnx; --from takes the directory"):
            begin_with(after, lesson, tmp_path / "nothing")
    turned = more.replace("joint_pos, joint_vel", "joint_vel, joint_pos")
    with anysim.make("reach", engine="mujoco", num_envs=4, overrides=[*QUIET, turned]) as env:
        other, lesson = made(env)
        with pytest.raises(TaskError, match=r"has learnt from \{'term': 'joint_pos'.*observation 1"):
            begin_with(other, lesson, tmp_path)
