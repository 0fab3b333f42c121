"""Batches, demonstrations and checkpoints: what learners are fed with, without any learner."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import anysim
from anysim.cli.options import option_values
from anysim.errors import PluginError, RecordError, TaskError
from anysim.record.reader import open_trajectory
from anysim.skills.runner import SkillPolicy
from anysim_learning import checkpoint, cli
from anysim_learning.batch import Batch
from anysim_learning.demonstrations import Demonstrations
from anysim_recording.collector import Collector
from tests.tasks.states import blinding

QUIET = ["record.cameras=[]"]
app = typer.Typer()
app.command()(cli.train)


def test_a_batch_is_the_env_with_actions_of_unit_range() -> None:
    halved = "world.robots.panda.actions.arm={controller: joint_delta_position, params: {scale: 0.06}}"
    overrides = [*QUIET, halved, "task.horizon=3"]
    generator = np.random.default_rng(0)
    with (
        anysim.make("reach", engine="mujoco", num_envs=3, overrides=overrides) as env,
        anysim.make("reach", engine="mujoco", num_envs=3, overrides=overrides) as same,
    ):
        batch = Batch(env)
        obs = batch.reset(4)
        expected, _ = same.reset(seed=4)
        assert np.array_equal(obs["policy"], expected["policy"])
        low, high = same.action_bounds
        total = np.zeros(3)
        for step in range(1, 4):
            action = generator.uniform(-1.5, 1.5, (3, env.action_dim))
            moment = batch.step(action)
            result = same.step((low + high) / 2 + (high - low) / 2 * np.clip(action, -1, 1))
            total += result.reward
            assert np.allclose(moment.reward, result.reward)
            assert moment.done.all() == (step == 3)
        assert moment.truncated.all()
        assert [one.total_reward for one in moment.ended] == pytest.approx(total.tolist())
        assert all(one.status == "truncated" and one.steps == 3 for one in moment.ended)
        for one in moment.ended:
            assert np.array_equal(one.obs["policy"], result.obs["policy"][one.env])
        same.reset()
        assert np.array_equal(moment.obs["policy"], same.obs["policy"]), "the next episodes have begun"


def test_a_batch_says_on_which_levels_its_envs_are() -> None:
    tiles = "world.terrain={kind: tiles, tiles: {rows: 3, columns: [rough], size: 4, choose: curriculum, start: 0}}"
    overrides = [*blinding("stand_still"), tiles, "task.horizon=1"]
    with anysim.make("stand_still", engine="null", num_envs=4, overrides=overrides, curriculum=True) as env:
        batch = Batch(env)
        batch.reset(0)
        assert env.scene.terrain is not None
        env.scene.terrain.promote(np.array([1, 2]), np.array([1, 2]))
        batch.step(np.zeros((4, env.action_dim)))
        found = batch.averages()
        assert (found["level"], found["level/0"], found["level/1"], found["level/2"]) == (0.75, 0.5, 0.25, 0.25)


def test_success_in_the_last_step_ends_no_more_than_the_time_does() -> None:
    lasting = "task.success={up: {term: not, of: {low: {term: below, frame: dog, height: 0.1}}}}"
    for horizon, hold, out_of_time in ((3, 3, True), (4, 3, False)):
        overrides = [*blinding("stand_still"), lasting, f"task.hold={hold}", f"task.horizon={horizon}"]
        with anysim.make("stand_still", engine="null", num_envs=2, overrides=overrides) as env:
            batch = Batch(env)
            batch.reset(0)
            for _ in range(3):
                moment = batch.step(np.zeros((2, env.action_dim)))
            assert [one.status for one in moment.ended] == ["success"] * 2
            assert moment.truncated.tolist() == [out_of_time] * 2


def test_a_batch_has_the_groups_that_are_asked_for() -> None:
    with anysim.make("push_cube", engine="mujoco", num_envs=1, overrides=QUIET) as env:
        assert set(Batch(env).reset(0)) == {"policy"}
        assert set(Batch(env, ("policy", "privileged")).reset(0)) == {"policy", "privileged"}
        with pytest.raises(TaskError, match=r"no observation group 'privilege' \(groups: policy, privileged\)"):
            Batch(env, ("privilege",))


def test_demonstrations_pair_what_was_seen_with_what_was_done(tmp_path: Path) -> None:
    with anysim.make("reach", engine="mujoco", num_envs=2, overrides=[*QUIET, "record.keep=all"]) as env:
        for _ in Collector(env, SkillPolicy(env), tmp_path / "run", 2, seed=3).run():
            pass
    data = Demonstrations([tmp_path / "run"], ("policy",), chunk=4)
    readers = [open_trajectory(path) for path in sorted((tmp_path / "run" / "episodes").iterdir())]
    assert len(data) == sum(reader.manifest.steps for reader in readers)
    first = readers[0]
    obs, chunk, mask = data[0]
    assert np.array_equal(obs["policy"], first.initial_obs["policy"].astype(np.float32))
    assert np.array_equal(chunk, first.actions[:4].astype(np.float32))
    assert mask.tolist() == [1, 1, 1, 1]
    last = first.manifest.steps - 1
    obs, chunk, mask = data[last]
    assert np.array_equal(obs["policy"], first.obs["policy"][last - 1].astype(np.float32))
    assert np.array_equal(chunk[0], first.actions[last].astype(np.float32))
    assert mask.tolist() == [1, 0, 0, 0]
    one = data.arrays([1])
    assert len(one[1]) == readers[1].manifest.steps
    with pytest.raises(TaskError, match="recorded without the observations depth"):
        Demonstrations([tmp_path / "run"], ("policy", "depth"))
    (tmp_path / "empty").mkdir()
    with pytest.raises(TaskError, match="has no successful trajectory"):
        Demonstrations([tmp_path / "empty"], ("policy",))


@pytest.mark.skipif(find_spec("torch") is not None, reason="torch is installed")
@pytest.mark.parametrize("learner", ["sb3-ppo", "rsl-rl", "clone"])
def test_without_torch_the_remedy_is_said(learner: str, tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["reach", "--learner", learner, "--out", str(tmp_path / "t")])
    assert isinstance(done.exception, PluginError)
    assert f"the learner '{learner}' needs " in str(done.exception)
    assert "pip install 'anysim-learning[" in str(done.exception)
    assert not (tmp_path / "t").exists()


def test_a_hyperparameter_is_yaml_and_what_is_none_is_a_sentence() -> None:
    assert option_values(["a=1e-3", "b=64", "c=mlp"], "gamma=0.99") == {"a": 1e-3, "b": 64, "c": "mlp"}
    for wrong, message in (("a", "expected KEY=VALUE"), ("a=[1", r"--option a=\[1: the value cannot be read")):
        with pytest.raises(TaskError, match=message):
            option_values([wrong], "gamma=0.99")


def test_a_checkpoint_comes_back_as_it_was(tmp_path: Path) -> None:
    tree = {
        "weights": {"a": np.arange(6.0).reshape(2, 3), "b": np.array(3)},
        "optimizer": {"state": {0: {"step": np.float32(2)}, 1: {}}, "groups": [{"lr": 1e-3, "betas": (0.9, 0.99)}]},
        "words": "yes",
        "none": None,
        "flag": True,
    }
    checkpoint.save(tmp_path / "c.npz", tree)
    back = checkpoint.load(tmp_path / "c.npz")
    assert np.array_equal(back["weights"]["a"], tree["weights"]["a"])
    assert back["weights"]["b"].shape == ()
    assert back["optimizer"]["state"][0]["step"] == 2.0
    assert back["optimizer"]["groups"] == [{"lr": 1e-3, "betas": [0.9, 0.99]}]
    assert (back["words"], back["none"], back["flag"]) == ("yes", None, True)
    data = (tmp_path / "c.npz").read_bytes()
    for cut in (0, 10, len(data) // 2, len(data) - 1):
        (tmp_path / "c.npz").write_bytes(data[:cut])
        with pytest.raises(RecordError, match="is damaged"):
            checkpoint.load(tmp_path / "c.npz")
