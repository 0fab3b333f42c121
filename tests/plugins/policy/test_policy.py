"""The controller `policy`: a small model that is made here, against numpy; clocks, snapshots, batches, bad files."""

import importlib.util
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
import yaml
from onnx import TensorProto, helper, numpy_helper

from anysim.conventions import Array
from anysim.errors import AnysimError, PluginError, TaskError
from anysim.task.env import TaskEnv
from anysim_policy import trust
from anysim_policy.spec import PolicySpec
from anysim_policy.trust import TRUSTED
from anysim_schemas.jsonschema import render
from tests.runtime import light

TERMS: list[Any] = [
    {"term": "base_ang_vel", "scale": 0.25}, "projected_gravity", {"term": "command", "scale": [2.0, 0.5]},
    "joint_pos", {"term": "joint_vel", "scale": 0.05}, "last_action", "clock",
]  # fmt: skip
SIZE = 3 + 3 + 2 + 2 + 2 + 2 + 2
SPEC: dict[str, Any] = {
    "model": "net.onnx",
    "joints": ["elbow", "shoulder"],
    "observations": TERMS,
    "commands": [{"name": "left", "low": -1, "high": 1}, {"name": "right", "low": -2, "high": 2}],
    "action_scale": [0.5, 0.25],
    "offset": {"elbow": 0.3},
    "period": 0.01,
    "frequency": 1.5,
}


def weights(size: int = SIZE, outputs: int = 2) -> list[Array]:
    rng = np.random.default_rng(5)
    shapes = ((size, 32), (32,), (32, outputs), (outputs,))
    return [(0.4 * rng.normal(size=shape)).astype(np.float32) for shape in shapes]


def net(path: Path, size: int = SIZE, outputs: int = 2, inputs: int = 1) -> Path:
    """tanh(x A + a) B + b, as an ONNX file."""
    names = ("A", "a", "B", "b")
    nodes = [
        helper.make_node("MatMul", ["x0", "A"], ["h0"]), helper.make_node("Add", ["h0", "a"], ["h1"]),
        helper.make_node("Tanh", ["h1"], ["h2"]), helper.make_node("MatMul", ["h2", "B"], ["h3"]),
        helper.make_node("Add", ["h3", "b"], ["y"]),
    ]  # fmt: skip
    graph = helper.make_graph(
        nodes,
        "net",
        [helper.make_tensor_value_info(f"x{i}", TensorProto.FLOAT, ["n", size]) for i in range(inputs)],
        [helper.make_tensor_value_info("y", TensorProto.FLOAT, ["n", outputs])],
        [numpy_helper.from_array(w, n) for n, w in zip(names, weights(size, outputs), strict=True)],
    )
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8), path)
    return path


def written(folder: Path, **changes: Any) -> Path:
    file = folder / "walk.yaml"
    file.write_text(yaml.safe_dump({k: v for k, v in {**SPEC, **changes}.items() if v is not None}))
    return file


def made(file: Path | str, n: int = 1, engine: str = "mujoco") -> TaskEnv:
    action = {"controller": "policy", "params": {"options": {"file": str(file)}}}
    spec = {
        "physics": {"dt": 0.005, "control_dt": 0.02},
        "world": {"name": "bench", "robots": {"arm": {"robot": "two_link", "position": [0, 0, 0.5], "yaw": 0.4,
                                                      "home_noise": 0.2, "actions": {"arm": action}}}},
        "task": {"horizon": 500, "observations": {"policy": ["joint_pos", "joint_vel"]}, "events": {}},
    }  # fmt: skip
    return light.make(engine, n, spec)


def test_the_output_is_that_of_numpy(tmp_path: Path) -> None:
    """Observation by observation: what the drives are commanded is what the formulas of the YAML file say."""
    net(tmp_path / "net.onnx")
    a1, b1, a2, b2 = weights()
    with made(written(tmp_path), 2) as env:
        assert env.action_spaces["arm.arm"].labels == ("left", "right")
        env.reset(seed=3)
        last, rng = np.zeros((2, 2)), np.random.default_rng(0)
        controller = env.actions.slices[0].controller
        for tick in range(12):
            command = rng.uniform(-1, 1, (2, 2))
            env.actions.act(env.actions.validated(command), None)
            state = env.engine.get_state()
            for part in range(2):  # every 0.01 s of the 0.02 s
                if part:
                    env.engine.step(2)
                    state = env.engine.get_state()
                    env.actions.update(1)
                turns = 2 * np.pi * (2 * tick + part) * 0.01 * 1.5
                position, rate = state.joint_pos[:, ::-1] - [0.3, 0.0], state.joint_vel[:, ::-1]
                parts = [
                    np.zeros((2, 3)), np.tile([0.0, 0.0, -1.0], (2, 1)), command * [2.0, 0.5], position, 0.05 * rate,
                    last, np.tile([np.sin(turns), np.cos(turns)], (2, 1)),
                ]  # fmt: skip
                x = np.concatenate(parts, axis=1).astype(np.float32)
                last = (np.tanh(x @ a1 + b1) @ a2 + b2).astype(float)
                targets = ([0.3, 0.0] + last * [0.5, 0.25])[:, ::-1]
                assert np.allclose(env.engine.control.position, targets, atol=1e-5)
                last = controller.snapshot(np.arange(2))["last"]
            env.engine.step(2)
        assert env.actions.schedule == (2, 2)
        assert np.abs(state.joint_vel).max() > 0.05, "it moves"


def test_a_row_does_not_depend_on_how_many_there_are(tmp_path: Path) -> None:
    net(tmp_path / "net.onnx")
    file = written(tmp_path)
    with made(file, 1) as one, made(file, 37) as many:
        for env in (one, many):
            env.reset(seed=1)
        for step in range(8):
            action = np.random.default_rng(step).uniform(-1, 1, (37, 2))
            assert np.array_equal(one.step(action[:1]).obs["policy"][0], many.step(action).obs["policy"][0])


def test_snapshots_go_on_bit_for_bit(tmp_path: Path) -> None:
    net(tmp_path / "net.onnx")
    with made(written(tmp_path), 3) as env:
        env.reset(seed=1)
        actions = np.random.default_rng(0).uniform(-1, 1, (20, 3, 2))
        for row in actions[:7]:
            env.step(row)
        kept = env.snapshot()
        first = [env.step(row).obs["policy"] for row in actions[7:]]
        env.reset(seed=8)
        env.reset_to(kept)
        assert all(np.array_equal(env.step(r).obs["policy"], f) for r, f in zip(actions[7:], first, strict=True))


@pytest.mark.parametrize("control_type", ["V", "T"])
def test_velocities_and_efforts(tmp_path: Path, control_type: str) -> None:
    net(tmp_path / "net.onnx")
    with made(written(tmp_path, control_type=control_type, period=None)) as env:
        env.reset(seed=0)
        env.step(np.ones((1, 2)))
        controller = env.actions.slices[0].controller
        wanted = (controller.snapshot(np.array([0]))["last"] * [0.5, 0.25])[:, ::-1]
        control = env.engine.control
        assert np.array_equal(control.velocity if control_type == "V" else control.effort, wanted)
        assert wanted.any()


@pytest.mark.parametrize(
    ("size", "outputs", "inputs", "changes", "words"),
    [
        (SIZE + 1, 2, 1, {}, r"takes an observation of shape .*17.*make \(1, 16\)"),
        (SIZE, 3, 1, {}, "gives 3 numbers for an observation, but it has 2 joints"),
        (SIZE, 2, 2, {}, "expected one of each"),
        (SIZE, 2, 1, {"period": 0.007}, "the policy's period of 0.007 s does not fit"),
        (SIZE, 2, 1, {"joints": ["elbow", "wrist"]}, "joint 'wrist' is not in 'arm.arm'"),
        (SIZE, 2, 1, {"joints": ["elbow"]}, "left out: shoulder"),
        (SIZE, 2, 1, {"action_scale": [1, 2, 3]}, "expected one number or 2, got 3"),
        (SIZE, 2, 1, {"model": "nett.onnx"}, "net.onnx"),
        (SIZE, 2, 1, {"model": "../net.onnx"}, "leaves its root"),
        (SIZE, 2, 1, {"observations": ["joint_poss"]}, "joint_pos"),
    ],
)
def test_what_does_not_fit_is_said(
    tmp_path: Path, size: int, outputs: int, inputs: int, changes: dict[str, Any], words: str
) -> None:
    folder = tmp_path / "policy"
    folder.mkdir()
    net(folder / "net.onnx", size, outputs, inputs)
    net(tmp_path / "net.onnx")
    with pytest.raises(AnysimError, match=words):
        made(written(folder, **changes), engine="null")


def test_no_way_leads_out_of_the_policys_folder(tmp_path: Path) -> None:
    folder = tmp_path / "policy"
    folder.mkdir()
    outside = net(tmp_path / "net.onnx")
    for model in (str(outside), f"file:{outside}"):
        with pytest.raises(TaskError, match="must be in the folder of the file"):
            made(written(folder, model=model), engine="null")
    (folder / "net.onnx").symlink_to(outside)
    with pytest.raises(TaskError, match="leaves its root"):
        made(written(folder), engine="null")


def test_a_damaged_model_is_named(tmp_path: Path) -> None:
    (tmp_path / "net.onnx").write_bytes(b"nonsense")
    with pytest.raises(TaskError, match=r"net.onnx is no ONNX model"):
        made(written(tmp_path), engine="null")


def test_without_the_runtime_the_remedy_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    net(tmp_path / "net.onnx")
    monkeypatch.setitem(__import__("sys").modules, "onnxruntime", None)
    with pytest.raises(PluginError, match=r"pip install 'anysim-policy\[onnx\]'"):
        made(written(tmp_path), engine="null")


@pytest.mark.skipif(importlib.util.find_spec("torch") is not None, reason="torch is installed")
def test_without_torch_the_remedy_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(TRUSTED, str(tmp_path))
    (tmp_path / "net.pt").write_bytes(b"")
    with pytest.raises(PluginError, match=r"pip install 'anysim-policy\[torch\]'"):
        made(written(tmp_path, model="net.pt"), engine="null")


@pytest.mark.skipif(importlib.util.find_spec("torch") is None, reason="torch is not installed")
@pytest.mark.filterwarnings("ignore:.torch.jit:FutureWarning")  # torch 2.14 still writes and reads such files
def test_torchscript_gives_what_numpy_gives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(TRUSTED, str(tmp_path))
    import torch  # pyright: ignore[reportMissingImports]

    a1, b1, a2, b2 = (torch.from_numpy(w) for w in weights())
    module = torch.nn.Sequential(torch.nn.Linear(SIZE, 32), torch.nn.Tanh(), torch.nn.Linear(32, 2))
    module.load_state_dict({"0.weight": a1.T, "0.bias": b1, "2.weight": a2.T, "2.bias": b2})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # as the loader does, see there
        torch.jit.script(module).save(str(tmp_path / "net.pt"))
    net(tmp_path / "net.onnx")
    seen = []
    for model in ("net.onnx", "net.pt"):
        with made(written(tmp_path, model=model)) as env:
            env.reset(seed=0)
            seen.append([env.step(np.ones((1, 2))).obs["policy"] for _ in range(10)])
    assert np.allclose(seen[0], seen[1], atol=1e-4)


def test_the_schema_for_editors_is_that_of_the_model() -> None:
    written = Path(trust.__file__).with_name("policy.schema.json").read_text()
    assert written == render(PolicySpec), "write anysim_schemas.jsonschema.render(PolicySpec) into it"
