"""Learners learn, stop and go on, and what they export does what their networks do. `make test-learning` runs these."""

import importlib
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import anysim
from anysim.errors import RecordError, TaskError
from anysim.record import incoming
from anysim.record.collector import Collector
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_engine
from anysim_learning import cli

torch = pytest.importorskip("torch", reason="the learners need torch: make test-learning")
pytestmark = pytest.mark.full

LEARNERS = {
    "sb3-ppo": ("anysim_learning.ppo", "Sb3Ppo", {"n_steps": 8, "batch_size": 16, "width": 16}),
    "rsl-rl": ("anysim_learning.rsl", "RslPpo", {"n_steps": 8, "width": 16}),
    "clone": ("anysim_learning.clone", "Clone", {"width": 16, "chunk": 3}),
    "transformer": ("anysim_learning.clone", "Clone", {"width": 16, "chunk": 3, "model": "transformer", "layers": 1}),
}
QUIET = ["record.cameras=[]"]


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    require_engine("mujoco")
    out = tmp_path_factory.mktemp("runs") / "reach"
    with anysim.make("reach", engine="mujoco", num_envs=4, overrides=QUIET) as env:
        assert all(result.status == "success" for result in Collector(env, SkillPolicy(env), out, 6, seed=3).run())
    return out


def learner(name: str, env: Any, runs: Path) -> tuple[Any, Any]:
    from anysim_learning.learner import Lesson

    module, made, options = LEARNERS[name]
    lesson = Lesson(env, ("policy",), 0, (runs,))
    return getattr(importlib.import_module(module), made)(lesson, **options), lesson


@pytest.mark.parametrize("name", LEARNERS)
def test_what_is_exported_does_what_the_network_does(name: str, runs: Path, tmp_path: Path) -> None:
    from anysim_learning.export import described, export
    from anysim_policy.env_policy import FileEnvPolicy

    with anysim.make("reach", engine="mujoco", num_envs=4, overrides=QUIET) as env:
        made, lesson = learner(name, env, runs)
        numbers = made.advance()
        assert all(np.isfinite(value) for value in numbers.values())
        network = made.network()
        export(network, described(env, lesson.groups, made.chunk), tmp_path / "p.onnx")
        policy = FileEnvPolicy(env, path=str(tmp_path / "p.onnx"))
        obs, _ = env.reset(seed=5)
        given = policy.act(obs, np.arange(4))
        with torch.inference_mode():
            wanted = network.eval()(torch.from_numpy(obs["policy"])).numpy()
        assert given.shape == ((4, 8) if made.chunk == 1 else (4, 3, 8))
        assert np.abs(given - wanted).max() < 1e-5
        assert (np.abs(given) <= 1.0 + 1e-6).all(), "within the bounds of the env"


@pytest.mark.parametrize("name", LEARNERS)
def test_a_learner_goes_on_where_it_was_put_away(name: str, runs: Path, tmp_path: Path) -> None:
    from anysim_learning import checkpoint

    with anysim.make("reach", engine="mujoco", num_envs=4, overrides=QUIET) as env:
        first, _ = learner(name, env, runs)
        first.advance()
        checkpoint.save(tmp_path / "c.npz", first.state())
        rows = torch.zeros(2, env.observation_sizes["policy"])
        with torch.inference_mode():
            before = first.network().eval()(rows).numpy().copy()
        other, _ = learner(name, env, runs)
        other.restore(checkpoint.load(tmp_path / "c.npz"))
        assert other.steps == first.steps
        with torch.inference_mode():
            assert np.array_equal(other.network().eval()(rows).numpy(), before)
        other.advance()
        assert other.steps == 2 * first.steps
        if name in ("clone", "transformer"):  # nothing of it depends on the envs
            first.advance()
            with torch.inference_mode():
                assert np.array_equal(other.network().eval()(rows).numpy(), first.network().eval()(rows).numpy())


def test_a_training_is_interrupted_and_goes_on(runs: Path, tmp_path: Path) -> None:
    from anysim_learning import checkpoint
    from anysim_learning.train import CHECKPOINT, CURVE, POLICY, describe_training, train

    told: list[Any] = []
    with (
        anysim.make("reach", engine="mujoco", num_envs=4, overrides=QUIET) as env,
        anysim.make("reach", engine="mujoco", num_envs=2, overrides=QUIET) as examined,
    ):
        describe_training(tmp_path, {"seed": 0})
        made, lesson = learner("sb3-ppo", env, runs)

        def stop(numbers: Any) -> None:
            told.append(numbers)
            if numbers["steps"] > 64:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            train(made, lesson, examined, 128, 4, tmp_path, stop)
        rows = [json.loads(line) for line in (tmp_path / CURVE).read_text().splitlines()]
        assert [row["steps"] for row in rows] == [32, 64]
        again, lesson = learner("sb3-ppo", env, runs)
        describe_training(tmp_path, {"seed": 0})
        numbers = train(again, lesson, examined, 128, 4, tmp_path, told.append)
        assert numbers["steps"] == 128
        rows = [json.loads(line) for line in (tmp_path / CURVE).read_text().splitlines()]
        assert [row["steps"] for row in rows] == [32, 64, 96, 128]
        assert all(0.0 <= row["exam"] <= 1.0 for row in rows)
        assert (tmp_path / POLICY).exists()
        assert list((tmp_path / "tensorboard").iterdir())
        with pytest.raises(TaskError, match=r"another training \(seed 0 there and 1 here\)"):
            describe_training(tmp_path, {"seed": 1})
        kept = checkpoint.load(tmp_path / CHECKPOINT)
        checkpoint.save(tmp_path / CHECKPOINT, {key: kept[key] for key in list(kept)[1:]})
        with pytest.raises(RecordError, match=f"checkpoint.npz has no '{next(iter(kept))}': another version wrote it"):
            train(again, lesson, examined, 256, 4, tmp_path, told.append)


def test_two_trainings_do_not_share_a_directory(tmp_path: Path) -> None:
    app = typer.Typer()
    app.command()(cli.train)
    words = ["reach", "-n", "2", "--steps", "32", "--exams", "1", "--option", "n_steps=8", "--out", str(tmp_path)]
    words += ["--option", "learning_rate=1e-3", "-e", "mujoco", "-o", "task.horizon=20", "--json"]
    with incoming.claim(tmp_path):
        assert "another run" in str(CliRunner().invoke(app, words).exception)
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.exception
    assert json.loads(done.output)["steps"] == 32
    assert json.loads((tmp_path / "train.json").read_text())["options"]["learning_rate"] == 1e-3


def test_the_view_of_sb3_is_one_that_sb3_accepts() -> None:
    from anysim_learning.sb3 import Sb3VecEnv

    with anysim.make("reach", engine="mujoco", num_envs=3, overrides=[*QUIET, "task.horizon=5"]) as env:
        view = Sb3VecEnv(env, ("policy",), seed=2)
        obs = view.reset()
        assert view.observation_space.contains(obs[0])
        for step in range(1, 11):
            obs, reward, done, infos = view.step(np.zeros((3, 8), np.float32))
            assert reward.dtype == np.float32
            assert done.all() == (step % 5 == 0)
            if done.all():
                assert all(info["TimeLimit.truncated"] and info["episode"]["l"] == 5 for info in infos)
                assert not np.array_equal(infos[0]["terminal_observation"], obs[0]), "that of the next episode"
        assert [one.status for one in view.batch.recent] == ["truncated"] * 6


def test_training_leaves_nothing_in_the_temporary_folder(
    runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with anysim.make("reach", engine="mujoco", num_envs=4, overrides=QUIET) as env:
        made, _ = learner("sb3-ppo", env, runs)
        made.advance()
    assert list(tmp_path.iterdir()) == []


def test_the_critic_of_rsl_rl_sees_what_the_actor_does_not() -> None:
    from anysim_learning.learner import Lesson
    from anysim_learning.rsl import RslPpo

    with anysim.make("push_cube", engine="mujoco", num_envs=3, overrides=QUIET) as env:
        made = RslPpo(Lesson(env, ("policy",), 0), n_steps=4, width=8)
        made.advance()
        algorithm = made._runner.alg
        sizes = env.observation_sizes
        assert algorithm.actor.obs_dim == sizes["policy"]
        assert algorithm.critic.obs_dim == sizes["policy"] + sizes["privileged"]


def test_rewards_are_scaled_by_the_deviation_of_the_return() -> None:
    from anysim_learning.return_scale import ReturnScale

    rng, scale = np.random.default_rng(0), ReturnScale(16, 0.9)
    returns, seen = np.zeros(16), []
    for _ in range(200):
        reward, done = rng.uniform(0.0, 50.0, 16), rng.random(16) < 0.05
        returns = 0.9 * returns + reward
        seen.append(returns.copy())
        scaled = scale(reward, done)
        returns[done] = 0.0
        assert np.allclose(scaled, np.clip(reward / np.std(seen), -10.0, 10.0), rtol=1e-6)
    again = ReturnScale(16, 0.9)
    again.restore(scale.state())
    again.begin(), scale.begin()
    late = np.full(16, 5.0)
    assert np.array_equal(again(late, late < 0), scale(late, late < 0))


def test_rsl_rl_learns_from_scaled_rewards() -> None:
    """Its updates move a value by 0.2 at most: returns of hundreds would take thousands of them."""
    from anysim_learning.learner import Lesson
    from anysim_learning.return_scale import ReturnScale
    from anysim_learning.rsl import RslPpo
    from anysim_learning.rsl_env import RslVecEnv

    with anysim.make("reach", engine="mujoco", num_envs=4, overrides=QUIET) as env:
        action, scale = torch.zeros(4, env.action_dim), ReturnScale(4, 0.98)
        view = RslVecEnv(env, seed=1)
        raw = torch.stack([view.step(action)[1] for _ in range(8)])
        view = RslVecEnv(env, 1, scale)
        rows = [view.step(action)[1] * scale.variance**0.5 for _ in range(8)]
        assert torch.allclose(torch.stack(rows), raw, rtol=1e-5)
        made = RslPpo(Lesson(env, ("policy",), 0), n_steps=16, width=8)
        made.advance()
        kept = made.state()["scale"]
        assert kept["count"] == 64
        assert kept["variance"] > 0.0
