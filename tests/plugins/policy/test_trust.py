"""Policies that nobody vouches for: no code is run, and no file outside of the model's folder is read."""

import os
import sys
from pathlib import Path
from types import ModuleType

import onnx
import pytest
from onnx import TensorProto, helper

from anysim.errors import TaskError
from anysim_policy.runtimes import load_model
from anysim_policy.trust import TRUSTED
from anysim_schemas.limits import POLICY_BYTES


class Torch(ModuleType):
    """Notes that it was asked to load something."""

    loaded: list[str]

    def __init__(self) -> None:
        super().__init__("torch")
        self.loaded = []
        self.jit = self

    def load(self, path: str, **_: object) -> object:
        self.loaded.append(path)
        raise RuntimeError("loaded")


@pytest.fixture
def torch(monkeypatch: pytest.MonkeyPatch) -> Torch:
    fake = Torch()
    monkeypatch.setitem(sys.modules, "torch", fake)
    return fake


@pytest.mark.parametrize("suffix", [".pt", ".jit"])
def test_torch_is_loaded_from_trusted_folders_alone(
    tmp_path: Path, torch: Torch, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / f"net{suffix}").touch()
    (tmp_path / "mine" / f"link{suffix}").symlink_to(f"../net{suffix}")
    monkeypatch.delenv(TRUSTED, raising=False)
    for trusted in (None, "", str(tmp_path / "mine"), f"{os.pathsep}{tmp_path / 'min'}"):
        if trusted is not None:
            monkeypatch.setenv(TRUSTED, trusted)
        for path in (tmp_path / f"net{suffix}", tmp_path / "mine" / f"link{suffix}"):
            with pytest.raises(TaskError, match="lies in no trusted folder: export it to ONNX, or name its folder in"):
                load_model(path, 3, 2)
    assert torch.loaded == []
    monkeypatch.setenv(TRUSTED, f"/nowhere{os.pathsep}{tmp_path}")
    with pytest.raises(TaskError, match="no TorchScript module"):
        load_model(tmp_path / f"net{suffix}", 3, 2)
    assert torch.loaded == [str(tmp_path / f"net{suffix}")]


def outside(location: str, size: int = 24) -> onnx.TensorProto:
    """A tensor (3, 2) whose numbers are in another file."""
    tensor = TensorProto(name="A", data_type=TensorProto.FLOAT, dims=[3, 2], data_location=TensorProto.EXTERNAL)
    for key, value in (("offset", "0"), ("location", location), ("length", str(size))):
        tensor.external_data.add(key=key, value=value)
    return tensor


def net(path: Path, location: str, place: str) -> Path:
    """y = x A with the numbers of A in another file; `place` is where the tensor is in the model."""
    nodes = [helper.make_node("MatMul", ["x", "A"], ["y"])]
    tensors = [outside(location)]
    if place == "constant":
        nodes.insert(0, helper.make_node("Constant", [], ["A"], value=tensors.pop()))
    if place == "branch":
        branch = helper.make_graph(
            [helper.make_node("Constant", [], ["t"], value=tensors.pop())],
            "then",
            [],
            [helper.make_tensor_value_info("t", TensorProto.FLOAT, [3, 2])],
        )
        nodes.insert(0, helper.make_node("If", ["c"], ["A"], then_branch=branch, else_branch=branch))
        tensors = [helper.make_tensor("c", TensorProto.BOOL, [], [True])]
    graph = helper.make_graph(
        nodes,
        "net",
        [helper.make_tensor_value_info("x", TensorProto.FLOAT, ["n", 3])],
        [helper.make_tensor_value_info("y", TensorProto.FLOAT, ["n", 2])],
        tensors,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    path.write_bytes(model.SerializeToString())
    return path


@pytest.mark.parametrize("place", ["initializer", "constant", "branch"])
@pytest.mark.parametrize("location", ["../secret.bin", "/etc/passwd", "link.bin", "deep/../../secret.bin", ""])
def test_onnx_data_stays_in_the_folder_of_its_model(tmp_path: Path, location: str, place: str) -> None:
    (tmp_path / "secret.bin").write_bytes(bytes(24))
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "link.bin").symlink_to("../secret.bin")
    with pytest.raises(TaskError, match="outside of its folder; save it with its data inside"):
        load_model(net(tmp_path / "mine" / "net.onnx", location, place), 3, 2)


def test_onnx_data_beside_its_model_is_read(tmp_path: Path) -> None:
    (tmp_path / "data.bin").write_bytes(bytes(24))
    assert load_model(net(tmp_path / "net.onnx", "data.bin", "initializer"), 3, 2) is not None
    with pytest.raises(TaskError, match="which is no file of its folder"):
        load_model(net(tmp_path / "net.onnx", "nil.bin", "initializer"), 3, 2)
    with (tmp_path / "data.bin").open("wb") as file:
        file.truncate(POLICY_BYTES.value)
    with pytest.raises(TaskError, match="the limit of a policy's model file"):
        load_model(net(tmp_path / "net.onnx", "data.bin", "initializer"), 3, 2)


@pytest.mark.parametrize(
    "data", [b"\xff" * 40, b"\x3a\xff\xff\xff\xff\x0f", b"\x3b", b"\x3a\x7f", b"\x09", b"no model", b"\x3a\x02\x2a\xff"]
)
def test_a_damaged_model_is_no_model(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "net.onnx").write_bytes(data)
    with pytest.raises(TaskError, match="is no ONNX model"):
        load_model(tmp_path / "net.onnx", 3, 2)


def test_a_pipe_is_no_model(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "net.onnx")
    with pytest.raises(TaskError, match="is a pipe, not a file"):
        load_model(tmp_path / "net.onnx", 3, 2)
