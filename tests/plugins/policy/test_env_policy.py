"""Policies of whole envs from files: what they say of themselves, rows, chunks, and files that do not fit."""

import json
import warnings
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

import anysim
from anysim.errors import TaskError
from anysim_policy.env_policy import FileEnvPolicy, ShippedEnvPolicy
from anysim_policy.trust import TRUSTED


def env_net(path: Path, about: Any = None, chunk: int = 1, size: int = 36, actions: int = 8) -> Path:
    """A file policy of the group `policy`: tanh of a fixed matrix; `about` overrides what it says of itself."""
    weights = np.random.default_rng(0).normal(0.0, 0.3, (size, actions * chunk)).astype(np.float32)
    shape = [1, actions] if chunk == 1 else [1, chunk, actions]
    nodes = [
        helper.make_node("MatMul", ["policy", "w"], ["x"]),
        helper.make_node("Tanh", ["x"], ["y"]),
        helper.make_node("Reshape", ["y", "shape"], ["action"]),
    ]
    fixed = [numpy_helper.from_array(weights, "w"), numpy_helper.from_array(np.array(shape), "shape")]
    inputs = [helper.make_tensor_value_info("policy", TensorProto.FLOAT, ["n", size])]
    outputs = [helper.make_tensor_value_info("action", TensorProto.FLOAT, shape)]
    model = helper.make_model(
        helper.make_graph(nodes, "net", inputs, outputs, fixed),
        opset_imports=[helper.make_opsetid("", 17)],
        ir_version=8,
    )
    said = {"format": "anysim-policy-1", "observations": {"policy": size}, "actions": actions, "chunk": chunk}
    if about is not False:
        helper.set_model_props(model, {"anysim": json.dumps(said | (about or {}))})
    onnx.save(model, path)
    return path


def reach(num_envs: int) -> Any:
    return anysim.make("reach", engine="mujoco", num_envs=num_envs, overrides=["record.cameras=[]"])


@pytest.mark.parametrize("chunk", [1, 3])
def test_a_file_drives_whole_envs_row_by_row(tmp_path: Path, chunk: int) -> None:
    path = env_net(tmp_path / "p.onnx", chunk=chunk)
    with reach(3) as env:
        policy = FileEnvPolicy(env, path=str(path))
        obs, _ = env.reset(seed=1)
        given = policy.act(obs, np.arange(3))
        weights = np.random.default_rng(0).normal(0.0, 0.3, (36, 8 * chunk)).astype(np.float32)
        wanted = np.tanh(obs["policy"] @ weights).reshape(given.shape)
        assert np.abs(given - wanted).max() < 1e-5
        assert given.shape == ((3, 8) if chunk == 1 else (3, 3, 8))
        one = policy.act({"policy": obs["policy"][1:2]}, np.array([1]))
        assert np.array_equal(one[0], given[1]), "the same bits alone"
        before = policy.version
        env_net(path, {"task": "other"}, chunk)
        assert FileEnvPolicy(env, path=str(path)).version != before


@pytest.mark.parametrize(
    ("about", "message"),
    [
        (False, r"p\.onnx does not say what it observes .* under the key 'anysim'"),
        ({"format": "other"}, r"its format is 'other'"),
        ({"observations": {"policy": 35}}, r"observes 35 numbers of 'policy'; 'reach' has 36"),
        ({"observations": {"camera": 3}}, r"'reach' has no such group \(groups: policy\)"),
        ({"actions": 7}, r"gives 7 numbers each 0 s; 'reach' takes 8 each 0\.02 s"),
        ({"control_dt": 0.1}, r"gives 8 numbers each 0\.1 s; 'reach' takes 8 each 0\.02 s"),
    ],
)
def test_a_file_that_does_not_fit_is_refused_with_a_sentence(tmp_path: Path, about: Any, message: str) -> None:
    path = env_net(tmp_path / "p.onnx", about)
    with reach(1) as env, pytest.raises(TaskError, match=message):
        FileEnvPolicy(env, path=str(path))


def test_files_that_are_none_are_refused(tmp_path: Path) -> None:
    (tmp_path / "p.onnx").write_bytes(b"nonsense")
    (tmp_path / "p.txt").write_bytes(b"nonsense")
    with reach(1) as env:
        for name, message in (("p.onnx", "no ONNX model"), ("p.txt", "no known kind"), ("q.onnx", "cannot be read")):
            with pytest.raises(TaskError, match=message):
                FileEnvPolicy(env, path=str(tmp_path / name))


def test_what_is_hidden_from_a_policy_is_named(tmp_path: Path) -> None:
    path = env_net(tmp_path / "p.onnx")
    with reach(1) as env:
        policy = FileEnvPolicy(env, path=str(path))
        with pytest.raises(TaskError, match="observes policy; --privileged shows it"):
            policy.act({}, np.arange(1))


@pytest.mark.skipif(find_spec("torch") is None, reason="torch is not installed: make test-learning")
@pytest.mark.filterwarnings("ignore:.torch.jit:FutureWarning")  # torch 2.14 still writes and reads such files
def test_torchscript_gives_what_onnx_gives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import torch  # pyright: ignore[reportMissingImports]

    env_net(tmp_path / "p.onnx")
    weights = np.random.default_rng(0).normal(0.0, 0.3, (36, 8)).astype(np.float32)
    layer = torch.nn.Linear(36, 8, bias=False)
    layer.load_state_dict({"weight": torch.from_numpy(weights.T.copy())})
    said = {"format": "anysim-policy-1", "observations": {"policy": 36}, "actions": 8}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # as the loader does, see there
        scripted = torch.jit.script(torch.nn.Sequential(layer, torch.nn.Tanh()))
        torch.jit.save(scripted, str(tmp_path / "p.pt"), _extra_files={"anysim": json.dumps(said)})
    with reach(2) as env:
        obs, _ = env.reset(seed=1)
        with pytest.raises(TaskError, match="lies in no trusted folder"):
            FileEnvPolicy(env, path=str(tmp_path / "p.pt"))
        monkeypatch.setenv(TRUSTED, str(tmp_path))
        given = [FileEnvPolicy(env, path=str(tmp_path / name)).act(obs, np.arange(2)) for name in ("p.onnx", "p.pt")]
        assert np.abs(given[0] - given[1]).max() < 1e-5


def test_a_task_that_ships_no_policy_says_so() -> None:
    with reach(1) as env, pytest.raises(TaskError, match=r"no trained policy comes with 'reach'; train one with"):
        ShippedEnvPolicy(env)


def test_a_shipped_file_that_is_not_there_is_refused_by_its_key() -> None:
    named = 'task.shipped="package:anysim_tasks/none.onnx"'
    with (
        anysim.make("reach", engine="mujoco", num_envs=1, overrides=["record.cameras=[]", named]) as env,
        pytest.raises(TaskError, match=r"of 'reach', which task\.shipped names: .*none\.onnx"),
    ):
        ShippedEnvPolicy(env)
