"""Policies of LeRobot: the same actions as LeRobot gives, what envs share, and directories that are refused.

`make test-learning` runs these where lerobot is installed.
"""

import json
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.errors import PluginError, TaskError
from anysim.testing.engines import require_engine
from anysim_evaluation.driver import drive, episode_seeds
from anysim_evaluation.policy import make_policy
from anysim_policy.lerobot import LeRobotEnvPolicy
from anysim_policy.lerobot_files import CONFIG, POSTPROCESSOR, PREPROCESSOR, WEIGHTS, load_directory

SEEN = ["record.cameras=[]", "task.images={front: {}}", "world.cameras.front.size=[64, 48]"]
STATE, FRONT = "observation.state", "observation.images.front"


def pretend(folder: Path, steps: Any = (), **about: Any) -> Path:
    """A directory with the names of LeRobot's files, and nothing in them that could be run."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in ((CONFIG, about), (PREPROCESSOR, {"steps": list(steps)}), (POSTPROCESSOR, {"steps": []})):
        (folder / name).write_text(json.dumps(content))
    (folder / WEIGHTS).write_bytes(b"")
    return folder


@pytest.mark.parametrize(
    ("lacking", "message"),
    [
        (CONFIG, r"has no config\.json \(there: model\.safetensors, .*save_pretrained writes it"),
        (WEIGHTS, r"has no model\.safetensors"),
        (PREPROCESSOR, r"has no policy_preprocessor\.json, which says how its numbers are scaled"),
    ],
)
def test_a_directory_that_lacks_a_file(tmp_path: Path, lacking: str, message: str) -> None:
    (pretend(tmp_path / "p") / lacking).unlink()
    with pytest.raises(TaskError, match=message):
        load_directory(tmp_path / "p", "cpu")
    with pytest.raises(TaskError, match="is no directory"):
        load_directory(tmp_path / "q", "cpu")


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        ([{"class": "os.system", "config": {}}], r"names code to import \(.*os\.system"),
        ([{"class": "os.system", "registry_name": "to_batch_processor"}], "names code to import"),
        (["x"], "names code to import"),
        ([{"registry_name": "normalizer_processor", "state_file": "../a.safetensors"}], "no file of its folder"),
        ([{"registry_name": "normalizer_processor", "state_file": "a.safetensors"}], "no file of its folder"),
    ],
)
def test_processors_that_are_not_only_data(tmp_path: Path, steps: Any, message: str) -> None:
    pretend(tmp_path / "p", steps)
    (tmp_path / "a.safetensors").write_bytes(b"")
    with pytest.raises(TaskError, match=message):
        load_directory(tmp_path / "p", "cpu")


def test_files_that_are_no_json_and_adapters(tmp_path: Path) -> None:
    with pytest.raises(TaskError, match="is an adapter of another model"):
        load_directory(pretend(tmp_path / "a", use_peft=True), "cpu")
    (pretend(tmp_path / "p") / CONFIG).write_text("[1]")
    with pytest.raises(TaskError, match=r"config\.json is no JSON mapping"):
        load_directory(tmp_path / "p", "cpu")
    (tmp_path / "p" / CONFIG).write_text("{")
    with pytest.raises(TaskError, match=r"config\.json is no JSON: "):
        load_directory(tmp_path / "p", "cpu")


def test_without_lerobot_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "draccus", None)
    with pytest.raises(PluginError, match=r"pip install 'anysim-policy\[lerobot\]'"):
        load_directory(pretend(tmp_path / "p"), "cpu")


@pytest.fixture(scope="module")
def lerobot() -> Any:
    pytest.importorskip("lerobot", reason="LeRobot's policies need lerobot, in an environment with torch")
    return pytest.importorskip("torch")


def save(folder: Path, kind: str, torch: Any, state: int = 36, actions: int = 8, **options: Any) -> Path:
    """A small policy with random weights, and scales that are not one."""
    from lerobot.configs.types import FeatureType, PolicyFeature  # pyright: ignore[reportMissingImports]
    from lerobot.policies import factory  # pyright: ignore[reportMissingImports]

    torch.manual_seed(0)
    inputs = {STATE: PolicyFeature(FeatureType.STATE, (state,)), FRONT: PolicyFeature(FeatureType.VISUAL, (3, 48, 64))}
    config = factory.make_policy_config(
        kind,
        device="cpu",
        input_features=inputs,
        output_features={"action": PolicyFeature(FeatureType.ACTION, (actions,))},
        pretrained_backbone_weights=None,
        **options,
    )
    rng = np.random.default_rng(0)

    def scales(shape: tuple[int, ...]) -> dict[str, Any]:
        mean, std = rng.normal(0.0, 0.3, shape), rng.uniform(0.2, 0.5, shape)
        values = {"mean": mean, "std": std, "min": mean - 2 * std, "max": mean + 2 * std}
        return {name: torch.as_tensor(value, dtype=torch.float32) for name, value in values.items()}

    stats = {STATE: scales((state,)), FRONT: scales((3, 1, 1)), "action": scales((actions,))}
    policy = factory.get_policy_class(kind)(config)
    policy.save_pretrained(folder)
    for processor in factory.make_pre_post_processors(config, dataset_stats=stats):
        processor.save_pretrained(folder)
    return folder


ACT = {"dim_model": 32, "n_heads": 2, "dim_feedforward": 64, "n_encoder_layers": 1, "use_vae": False, "chunk_size": 6}
DIFFUSION = {
    "down_dims": (16, 32),
    "n_groups": 4,
    "diffusion_step_embed_dim": 16,
    "spatial_softmax_num_keypoints": 4,
    "crop_shape": None,
    "horizon": 8,
    "n_action_steps": 3,
    "num_train_timesteps": 4,
    "num_inference_steps": 2,
}


@pytest.fixture(scope="module")
def act(lerobot: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save(tmp_path_factory.mktemp("act"), "act", lerobot, n_action_steps=4, **ACT)


@pytest.fixture(scope="module")
def reach() -> Iterator[Any]:
    require_engine("mujoco")
    with anysim.make("reach", engine="mujoco", num_envs=2, overrides=[*SEEN, "task.horizon=12"]) as env:
        yield env


def theirs(folder: Path, kind: str, torch: Any) -> Any:
    """What LeRobot itself gives in each step for observations as its own loop makes them."""
    from lerobot.policies import factory  # pyright: ignore[reportMissingImports]

    policy = factory.get_policy_class(kind).from_pretrained(folder)
    policy.reset()
    before, after = factory.make_pre_post_processors(policy.config, str(folder))

    def act(obs: Any, row: int) -> Any:
        image = torch.from_numpy(obs["images/front"][row].copy()).permute(2, 0, 1).unsqueeze(0) / 255
        state = torch.from_numpy(obs["policy"][row : row + 1]).float()
        return after(policy.select_action(before({STATE: state, FRONT: image, "task": ["reach"]}))).numpy()[0]

    return act


def test_a_chunk_is_what_lerobot_carries_out(act: Path, reach: Any, lerobot: Any) -> None:
    policy = LeRobotEnvPolicy(reach, path=str(act))
    obs, _ = reach.reset(seed=1)
    policy.reset(np.arange(2))
    given = policy.act(obs, np.arange(2))
    assert given.shape == (2, 4, 8)
    for row in range(2):
        their = theirs(act, "act", lerobot)
        wanted = np.array([their(obs, row) for _ in range(4)])  # the first makes the chunk, the others take from it
        assert np.abs(given[row] - wanted).max() < 1e-5
    assert np.abs(given[0] - given[1]).max() > 1e-3, "the observations differ, and so do the actions"
    assert np.array_equal(policy.act({name: rows[1:] for name, rows in obs.items()}, np.array([1]))[0], given[1])
    short = LeRobotEnvPolicy(reach, path=str(act), steps=2, keys=f"{STATE}:policy+{FRONT}:images/front")
    assert np.array_equal(short.act(obs, np.arange(2)), given[:, :2])


def test_a_policy_that_remembers_is_asked_in_each_step(reach: Any, lerobot: Any, tmp_path: Path) -> None:
    folder = save(tmp_path / "e", "act", lerobot, n_action_steps=1, temporal_ensemble_coeff=0.01, **ACT)
    policy, their = make_policy(reach, f"lerobot:{folder}"), theirs(folder, "act", lerobot)
    obs, _ = reach.reset(seed=2)
    policy.reset(np.arange(2))
    for _ in range(5):
        given = policy.act(obs, np.arange(2))
        assert given.shape == (2, 1, 8)
        assert np.abs(given[1, 0] - their(obs, 1)).max() < 1e-5
        obs = reach.step(given[:, 0]).obs
    with pytest.raises(TaskError, match=r"policy\.steps: .* is asked in each step"):
        make_policy(reach, f"lerobot:{folder},steps=3")


def test_episodes_do_not_depend_on_the_number_of_envs(reach: Any, lerobot: Any, tmp_path: Path) -> None:
    """A policy that remembers two observations and draws noise: neither is shared by the envs."""
    folder = save(tmp_path / "d", "diffusion", lerobot, **DIFFUSION)
    seeds = episode_seeds("validation", 0, 3)
    state = lerobot.random.get_rng_state()
    many = sorted(drive(reach, make_policy(reach, f"lerobot:{folder}"), seeds), key=lambda one: one.seed)
    assert lerobot.equal(lerobot.random.get_rng_state(), state), "the draws of others are left alone"
    with anysim.make("reach", engine="mujoco", num_envs=1, overrides=[*SEEN, "task.horizon=12"]) as env:
        alone = list(drive(env, make_policy(env, f"lerobot:{folder}"), seeds))
    assert alone == many
    assert len({one.total_reward for one in many}) == 3


def test_loading_prints_and_leaves_nothing(
    act: Path, reach: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    before = LeRobotEnvPolicy(reach, path=str(act)).version
    assert capsys.readouterr().out == ""
    assert list(tmp_path.iterdir()) == []
    other = shutil.copytree(act, tmp_path / "other")
    stats = next(path for path in other.glob("policy_postprocessor*.safetensors"))
    data = bytearray(stats.read_bytes())
    data[-1] ^= 1
    stats.write_bytes(data)
    assert LeRobotEnvPolicy(reach, path=str(other)).version != before


def test_weights_that_are_not_all_there_are_refused(act: Path, reach: Any, tmp_path: Path) -> None:
    from safetensors.numpy import load_file, save_file  # pyright: ignore[reportMissingImports]

    folder = shutil.copytree(act, tmp_path / "p")
    weights = load_file(folder / WEIGHTS)
    weights.pop(sorted(weights)[0])
    save_file(weights, folder / WEIGHTS)
    with pytest.raises(TaskError, match="cannot be loaded by lerobot: "):
        LeRobotEnvPolicy(reach, path=str(folder))
    (folder / WEIGHTS).write_bytes(b"nonsense")
    with pytest.raises(TaskError, match="cannot be loaded by lerobot: "):
        LeRobotEnvPolicy(reach, path=str(folder))


def test_a_task_that_does_not_fit_is_refused(act: Path, lerobot: Any, reach: Any, tmp_path: Path) -> None:
    path = str(act)
    for options, message in (
        ({"keys": f"{FRONT}:images/side"}, r"no THEIRS:OURS with an observation of 'reach'"),
        ({"keys": "observation.images.top:images/front"}, r"does not take observation\.images\.top, but"),
        ({"steps": 7}, r"gives chunks of 6 steps, fewer than 7"),
        ({"keys": f"{STATE}:images/front"}, r"of shape \(36,\); 'images/front' of 'reach' is \(3, 48, 64\)"),
    ):
        with pytest.raises(TaskError, match=message):
            LeRobotEnvPolicy(reach, path=path, **options)  # pyright: ignore[reportArgumentType]
    with anysim.make("reach", engine="mujoco", num_envs=1, overrides=["record.cameras=[]"]) as blind:
        with pytest.raises(TaskError, match=r"'reach' has no 'images/front' .*`-o 'task\.images="):
            LeRobotEnvPolicy(blind, path=path)
    seven = save(tmp_path / "seven", "act", lerobot, actions=7, **ACT, n_action_steps=1)
    with pytest.raises(TaskError, match=r"gives actions of shape \(7,\); 'reach' takes \(8,\): "):
        LeRobotEnvPolicy(reach, path=str(seven))
    obs, _ = reach.reset(seed=1)
    with pytest.raises(TaskError, match=r"observes images/front; --privileged shows it"):
        LeRobotEnvPolicy(reach, path=path).act({"policy": obs["policy"]}, np.arange(2))
