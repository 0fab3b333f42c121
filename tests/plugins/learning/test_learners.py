"""Learners learn, stop and go on, and what they export does what their networks do. `make test-learning` runs these."""

import importlib
import json
import shutil
import tempfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import typer
from PIL import Image
from typer.testing import CliRunner

import anysim
from anysim.errors import EngineError, RecordError, TaskError
from anysim.record import incoming
from anysim.record.reader import open_trajectory
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_drawing, require_engine
from anysim_learning import cli
from anysim_recording.collector import Collector

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


def test_a_file_says_what_its_robot_was_and_what_it_was_shown() -> None:
    import json

    from anysim_learning.export import described

    with anysim.make("reach", engine="mujoco", num_envs=1, overrides=QUIET) as env:
        told = json.loads(json.dumps(described(env, ("policy",)).model_dump()))
        robot, world = told["robots"]["panda"], env.engine.world
        assert robot["model"] == "franka_panda"
        assert len(robot["hash"]) == 64
        assert robot["kp"] == [drive.kp for drive in world.actuators]
        assert robot["armature"] == [world.joints[drive.joint].armature for drive in world.actuators]
        assert set(robot["actions"]) == {"arm", "eef"}
        assert [term["term"] for term in told["terms"]["policy"]][:2] == ["joint_pos", "joint_vel"]
        assert told["dt"] == world.physics.dt


def test_an_output_can_reach_a_share_of_the_range() -> None:
    from anysim_learning.rsl_env import RslVecEnv

    with anysim.make("reach", engine="mujoco", num_envs=2, overrides=QUIET) as env:
        view = RslVecEnv(env, 0, None, 0.25)
        view.step(torch.ones(2, env.action_dim))
        _, high = env.action_bounds
        assert np.allclose(env.scene.last_action, 0.25 * high)


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
    with anysim.make("reach", engine="mujoco", num_envs=4, overrides=QUIET) as env:
        whole, _ = learner(name, env, runs)
        whole.advance(), whole.advance()
        with torch.inference_mode():
            assert np.array_equal(other.network().eval()(rows).numpy(), whole.network().eval()(rows).numpy())


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


def test_of_policies_that_solve_as_much_the_one_of_the_greatest_reward_is_kept(
    runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import onnx

    from anysim_learning import exam
    from anysim_learning.train import POLICY, train
    from anysim_schemas.policy_file import METADATA

    marks = [exam.Mark(0.5, 9.0), exam.Mark(1.0, 3.0), exam.Mark(1.0, 4.0), exam.Mark(1.0, 2.0)]
    left = iter(marks)
    monkeypatch.setattr(exam, "exam", lambda *_: next(left))
    with anysim.make("reach", engine="mujoco", num_envs=4, overrides=QUIET) as env:
        made, lesson = learner("sb3-ppo", env, runs)
        numbers = train(made, lesson, env, 128, len(marks), tmp_path, lambda _: None)
    assert (numbers["exam"], numbers["exam_reward"], numbers["best"]) == (1.0, 2.0, 1.0)
    notes = {note.key: note.value for note in onnx.load(str(tmp_path / POLICY)).metadata_props}
    assert json.loads(notes[METADATA])["steps"] == 96


def test_an_exam_is_marked_by_success_and_reward() -> None:
    from anysim_learning.exam import exam

    class Still(torch.nn.Module):
        def forward(self, row: Any) -> Any:
            return torch.zeros(len(row), 8)

    with anysim.make("reach", engine="mujoco", num_envs=2, overrides=[*QUIET, "task.horizon=5"]) as env:
        mark = exam(env, ("policy",), Still())
        env.reset(episode_seeds=[10_000, 10_001])
        total = sum(env.step(np.zeros((2, 8))).reward.mean() for _ in range(5))
    assert mark.success == 0.0
    assert mark.reward == pytest.approx(total)


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


SEEN = [*QUIET, "task.images={front: {fps: 25.0}}", "world.cameras.front.size=[96, 66]"]
FRONT = "images/front"


@pytest.fixture(scope="module")
def filmed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two episodes of reach whose front camera is recorded as it is observed."""
    require_engine("mujoco")
    out = tmp_path_factory.mktemp("runs") / "filmed"
    overrides = [*SEEN, "record.cameras=[front]", "record.fps=25.0"]
    with anysim.make("reach", engine="mujoco", num_envs=2, overrides=overrides) as env:
        assert all(result.status == "success" for result in Collector(env, SkillPolicy(env), out, 2, seed=3).run())
    return out


def test_recorded_images_are_those_that_were_observed(filmed: Path) -> None:
    """The latest image before each action, but for what the video loses."""
    from anysim_learning.demonstrations import Demonstrations
    from anysim_learning.images import reduced

    data = Demonstrations([filmed], ("policy",), 2, images=(FRONT,), prepare=lambda images: reduced(images, 2))
    one = data.trajectories[0]
    assert one.images[FRONT].shape[1:] == (33, 48, 3)
    assert one.shown[FRONT].tolist() == [step // 2 for step in range(len(one.action))]
    with anysim.make("reach", engine="mujoco", num_envs=2, overrides=SEEN) as env:
        folders = sorted((filmed / "episodes").iterdir())
        env.reset(episode_seeds=[open_trajectory(folder).manifest.episode_seed for folder in folders])
        for step in range(min(len(trajectory.action) for trajectory in data.trajectories) - 1):
            assert np.abs(data[step][0]["policy"] - env.obs["policy"][0]).max() < 1e-4
            seen = reduced(env.obs[FRONT], 2)[0].astype(float)
            far = np.abs(one.images[FRONT] - seen).mean(axis=(1, 2, 3))
            assert far[one.shown[FRONT][step]] < 5.0
            assert abs(int(far.argmin()) - one.shown[FRONT][step]) <= 1, "neighbours may look alike"
            assert np.array_equal(data[step][0][FRONT], one.images[FRONT][one.shown[FRONT][step]])
            env.step(np.stack([trajectory.action[step] for trajectory in data.trajectories]))
    frames, shown = data.frames([1])[FRONT]
    assert len(shown) == len(data.trajectories[1].action)
    assert np.array_equal(frames[shown[3]], data[len(one.action) + 3][0][FRONT])


def test_images_are_reduced_alike_outside_and_inside_of_a_network() -> None:
    from anysim_learning.images import Reduce, reduced, reduction, shifted

    assert [reduction(*size) for size in ((48, 64), (48, 65), (240, 320), (8, 8))] == [1, 2, 5, 1]
    images = np.random.default_rng(0).integers(0, 256, (2, 14, 19, 3), dtype=np.uint8)
    for factor in (1, 3, 5):
        within = Reduce(factor)(torch.as_tensor(images)).numpy()
        assert np.array_equal(within, reduced(images, factor).astype(np.float32))
    still = torch.as_tensor(np.repeat(images[:1], 40, axis=0))
    moved = shifted(still, 2, torch.Generator().manual_seed(0)).numpy()
    middles = {bytes(image[4:9, 4:9]) for image in moved}
    wanted = {bytes(images[0, 4 + y : 9 + y, 4 + x : 9 + x]) for y in range(-2, 3) for x in range(-2, 3)}
    assert middles <= wanted
    assert len(middles) > 10
    assert shifted(still, 0, torch.Generator()) is still


@pytest.mark.parametrize("model", ["mlp", "transformer"])
def test_cloning_from_images(model: str, filmed: Path, tmp_path: Path) -> None:
    """It learns a tiny run by heart with what the images show, and the file gives the same actions."""
    from anysim_learning.clone import Clone
    from anysim_learning.export import described, export
    from anysim_learning.learner import Lesson
    from anysim_policy.env_policy import FileEnvPolicy

    with anysim.make("reach", engine="mujoco", num_envs=2, overrides=SEEN) as env:
        lesson = Lesson(env, ("policy",), 0, (filmed,), (FRONT,))
        options: Any = {"width": 32, "layers": 2, "chunk": 3, "batch_size": 16, "noise": 0.0, "average": 0.9}
        made = Clone(lesson, model=model, shift=0, **options)  # pyright: ignore[reportArgumentType]
        losses = [made.advance()["loss"] for _ in range(4)]
        assert losses[-1] < 0.5 * losses[0]
        network = made.network().eval()
        export(network, described(env, lesson.groups, made.chunk, lesson.images), tmp_path / "p.onnx")
        obs, _ = env.reset(seed=5)
        policy = FileEnvPolicy(env, path=str(tmp_path / "p.onnx"))
        given = policy.act(obs, np.arange(2))
        with torch.inference_mode():
            wanted = network(torch.from_numpy(obs["policy"]), torch.from_numpy(obs[FRONT])).numpy()
        assert given.shape == (2, 3, 8)
        assert np.abs(given - wanted).max() < 1e-5
        dark = policy.act(obs | {FRONT: np.zeros_like(obs[FRONT])}, np.arange(2))
        assert np.abs(dark - given).max() > 1e-3, "it looks at them"
        with pytest.raises(TaskError, match="observes images/front; --privileged shows it"):
            policy.act({"policy": obs["policy"]}, np.arange(2))
    for overrides, message in (
        (QUIET, r"observes 'images/front' of 96 x 66 pixels, 'reach' does not show it: set task\.images"),
        ([*SEEN, "world.cameras.front.size=[64, 48]"], r"'reach' shows 64 x 48: set"),
    ):
        with anysim.make("reach", engine="mujoco", num_envs=1, overrides=overrides) as env:
            with pytest.raises(TaskError, match=message):
                FileEnvPolicy(env, path=str(tmp_path / "p.onnx"))


def test_runs_that_do_not_show_what_the_task_shows(runs: Path, filmed: Path) -> None:
    from anysim_learning.clone import Clone
    from anysim_learning.learner import Lesson

    for data, override, message in (
        (runs, "world.cameras.front.size=[96, 66]", r"recorded without images of 'front' from the start"),
        (filmed, "world.cameras.front.size=[64, 48]", r"'front' with 96 x 66 pixels in every 2\. step; .* 64 x 48 in"),
        (filmed, "task.images.front.fps=50", r"96 x 66 in every 1\.: set .* task\.images\.front\.fps"),
    ):
        with anysim.make("reach", engine="mujoco", num_envs=1, overrides=[*SEEN, override]) as env:
            with pytest.raises(TaskError, match=message):
                Clone(Lesson(env, ("policy",), 0, (data,), (FRONT,)))


def test_the_command_clones_from_images_and_evaluates(filmed: Path, tmp_path: Path) -> None:
    """The images that the task observes are inputs of the file, and the examiner shows them to it."""
    app = typer.Typer()
    app.command()(cli.train)
    words = ["reach", "-l", "clone", "-n", "1", "--steps", "100", "--exams", "1", "--data", str(filmed), "-e", "mujoco"]
    words += [word for override in [*SEEN[1:], "task.horizon=4"] for word in ("-o", override)]
    words += ["--option", "width=8", "--option", "batch_size=8", "--out", str(tmp_path / "out"), "--json"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.exception
    assert json.loads((tmp_path / "out" / "train.json").read_text())["groups"] == ["policy", FRONT]
    with anysim.make("reach", engine="mujoco", num_envs=2, overrides=[*SEEN, "task.horizon=4"]) as env:
        from anysim_evaluation.driver import drive
        from anysim_evaluation.policy import make_policy

        policy = make_policy(env, str(tmp_path / "out" / "policy.onnx"))
        assert [one.status for one in drive(env, policy, [10_000, 10_001])] == ["truncated"] * 2


def test_the_best_policy_is_filmed_and_its_curves_are_drawn(tmp_path: Path) -> None:
    require_drawing("mujoco")
    app = typer.Typer()
    for command in (cli.train, cli.curves):
        app.command()(command)
    out = tmp_path / "out"
    words = ["train", "reach", "-n", "2", "--steps", "32", "--exams", "2", "--option", "n_steps=8", "-e", "mujoco"]
    words += ["-o", "task.horizon=20", "-o", "world.cameras.front.size=[64, 48]", "--out", str(out)]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.exception
    assert "processor time: " in done.output
    with Image.open(out / "videos" / "best.webp") as video:
        assert (video.size, getattr(video, "n_frames", 1)) == ((64, 48), 5)
    text = (out / "curves.html").read_text("utf-8")
    assert 'src="videos/best.webp"' in text
    assert ElementTree.fromstring(text.partition("\n")[2]) is not None
    rows = [json.loads(line) for line in (out / "curve.jsonl").read_text().splitlines()]
    assert 0.0 < rows[0]["cpu_s"] <= rows[1]["cpu_s"]
    page = tmp_path / "pages" / "both.html"
    shutil.copytree(out, tmp_path / "again")
    done = CliRunner().invoke(app, ["curves", str(out), str(tmp_path / "again"), "--out", str(page)])
    assert done.exit_code == 0, done.exception
    assert page.read_text("utf-8").count("<polyline") == 2 * text.count("<polyline")
    missing = CliRunner().invoke(app, ["curves", str(tmp_path / "none"), "--out", str(page)])
    assert "has no exams" in str(missing.exception)


def test_a_training_ends_well_where_nothing_draws(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def dark(*_: Any, **__: Any) -> Any:
        raise EngineError("there is no renderer here")

    monkeypatch.setattr(TaskEnv, "render", dark)
    app = typer.Typer()
    app.command()(cli.train)
    words = ["reach", "-n", "2", "--steps", "16", "--exams", "1", "--option", "n_steps=8", "-e", "mujoco"]
    done = CliRunner().invoke(app, [*words, "-o", "task.horizon=20", "--out", str(tmp_path)])
    assert done.exit_code == 0, done.exception
    assert "no video of the policy: there is no renderer here" in done.stderr
    assert (tmp_path / "policy.onnx").exists()
    assert "<img" not in (tmp_path / "curves.html").read_text()
