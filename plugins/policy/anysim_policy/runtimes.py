"""Model files as functions of one observation. Rows are run one by one: a row must not depend on those beside it.

A model that is given a batch may sum in another order than for one row, so its last bits would depend on how many envs
there are. ONNX models run in one thread for the same reason, and because the envs are many and the models small;
torch's number of threads is that of the process, which is the caller's to set.
"""

import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from anysim.conventions import Array
from anysim.errors import PluginError, TaskError
from anysim_policy.trust import check_onnx, check_torch
from anysim_schemas.policy_file import METADATA


class Runtime(Protocol):
    """A model that is ready to run."""

    def __call__(self, row: Array) -> Array:
        """The output (A,) for an observation (D,), both float32."""
        ...


def load_model(path: Path, size: int, outputs: int) -> Runtime:
    """The model of a file, which takes observations of `size` and gives `outputs` numbers.

    Raises:
        PluginError: the package that runs it is not installed.
        TaskError: it is damaged, of an unknown kind, not trusted, or has other sizes.
    """
    kinds = {".onnx": _onnx, ".pt": _torch, ".jit": _torch}
    if path.suffix not in kinds:
        raise TaskError(f"the policy {path} is of no known kind; expected {', '.join(kinds)}")
    model = kinds[path.suffix](path, size)
    try:
        given = model(np.zeros(size, dtype=np.float32))
    except Exception as error:
        words = str(error).strip().splitlines()
        raise TaskError(
            f"the policy {path} does not take observations (1, {size}): {words[0] if words else error!r}"
        ) from error
    if given.shape != (outputs,):
        raise TaskError(
            f"the policy {path} gives {given.shape[-1] if given.ndim else 0} numbers for an observation, but it has "
            f"{outputs} joints to command"
        )
    return model


def described_model(path: Path) -> tuple[str, Callable[[Mapping[str, Array]], Array]]:
    """What the file of a model says of itself under `anysim`, and a function of its inputs (1, D) float32 by name.

    Raises:
        PluginError: the package that runs it is not installed.
        TaskError: it is damaged, of an unknown kind, or not trusted.
    """
    if path.suffix == ".onnx":
        session = _session(path)
        said = str(session.get_modelmeta().custom_metadata_map.get(METADATA, ""))
        return said, lambda inputs: np.asarray(session.run(None, dict(inputs))[0])
    if path.suffix not in (".pt", ".jit"):
        raise TaskError(f"the policy {path} is of no known kind; expected .onnx, .pt, .jit")
    torch, module, said = _module(path)

    def run(inputs: Mapping[str, Array]) -> Array:
        with torch.inference_mode():
            return module(*(torch.from_numpy(rows) for rows in inputs.values())).numpy()

    return said, run


def _session(path: Path) -> Any:
    """An ONNX model, ready to run in one thread."""
    check_onnx(path)
    try:
        import onnxruntime
    except ImportError as error:
        raise PluginError(f"ONNX policies need onnxruntime ({error}): pip install 'anysim-policy[onnx]'") from None
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    options.use_deterministic_compute = True
    options.log_severity_level = 4  # what fails is raised
    try:
        session: Any = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:
        raise TaskError(f"the policy {path} is no ONNX model that onnxruntime reads: {error}") from error
    return session


def _onnx(path: Path, size: int) -> Runtime:
    session = _session(path)
    inputs, outputs = session.get_inputs(), session.get_outputs()
    if len(inputs) != 1 or len(outputs) != 1:
        raise TaskError(
            f"the policy {path} has inputs {[i.name for i in inputs]} and outputs {[o.name for o in outputs]}; "
            "expected one of each (recurrent policies keep their state in further ones and cannot be run)"
        )
    shape = inputs[0].shape
    if len(shape) != 2 or (isinstance(shape[1], int) and shape[1] != size):
        raise TaskError(
            f"the policy {path} takes an observation of shape {shape}, but the terms of its YAML file make (1, {size})"
        )
    name, wanted = inputs[0].name, [outputs[0].name]

    def run(row: Array) -> Array:
        found: Any = session.run(wanted, {name: row[None]})[0]
        return np.asarray(found).reshape(-1)

    return run


def _torch(path: Path, size: int) -> Runtime:
    torch, module, _ = _module(path)

    def run(row: Array) -> Array:
        with torch.inference_mode():
            return module(torch.from_numpy(row[None])).numpy().reshape(-1)

    return run


def _module(path: Path) -> tuple[Any, Any, str]:
    """torch, a TorchScript module, and what its extra file `anysim` says."""
    check_torch(path)
    try:
        import torch  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise PluginError(f"TorchScript policies need torch ({error}): pip install 'anysim-policy[torch]'") from None
    try:
        with warnings.catch_warnings():
            # Newer versions would rather have exported programs; the policies that people publish are TorchScript.
            warnings.simplefilter("ignore", DeprecationWarning)
            extra = {METADATA: ""}
            module = torch.jit.load(str(path), map_location="cpu", _extra_files=extra).eval()
    except Exception as error:
        raise TaskError(f"the policy {path} is no TorchScript module: {error}") from error
    said: str | bytes = extra[METADATA]
    return torch, module, said.decode() if isinstance(said, bytes) else said
