"""Policies of whole envs from files that say what they observe: ONNX, as `anysim train` writes it, and TorchScript.

A file is named by its path, or by the task that it comes with.
"""

import hashlib
import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from anysim.assets.uri import locate
from anysim.conventions import Array
from anysim.errors import AssetError, TaskError, listing
from anysim.task.contract import Obs
from anysim.task.env import TaskEnv
from anysim_policy.runtimes import described_model
from anysim_schemas.files import RefusedFileError, read_plain
from anysim_schemas.limits import POLICY_BYTES
from anysim_schemas.policy_file import FORMAT, METADATA, PolicyFileSpec


class FileEnvPolicy:
    """A model of observation groups, (1, D) float32 each, and images, (1, H, W, 3) uint8 each, to actions.

    These are actions (1, A) or chunks (1, K, A) in the env's units.

    It is run row by row: a batch may be summed in another order, and an episode would depend on its neighbours. What is
    not a number is 0 to it, as it is to learners.

    Attributes:
        version: of the file: the digest of its bytes.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        path: Annotated[str, Field(description="the .onnx file; .pt or .jit in a trusted folder")],
    ) -> None:
        self._path, self._dim = Path(path), env.action_dim
        try:
            self.version = hashlib.sha256(read_plain(self._path, POLICY_BYTES)).hexdigest()[:16]
        except RefusedFileError as error:
            raise TaskError(f"the policy {path} {error.strerror}") from error
        except OSError as error:
            raise TaskError(f"the policy {path} cannot be read: {error.strerror}") from error
        text, self._run = described_model(self._path)
        self._about = self._checked(text, env)

    def _checked(self, text: str, env: TaskEnv) -> PolicyFileSpec:
        try:
            about = PolicyFileSpec.model_validate(json.loads(text))
            if about.format != FORMAT:
                raise ValueError(f"its format is '{about.format}'")
        except ValueError as error:
            raise TaskError(
                f"the policy {self._path} does not say what it observes ({error}); expected JSON of the format "
                f"{FORMAT} under the key '{METADATA}' of its metadata, as `anysim train` writes it"
            ) from None
        sizes = env.observation_sizes
        for group, size in about.observations.items():
            if sizes.get(group) != size:
                here = f"has {sizes[group]}" if group in sizes else f"has no such group (groups: {listing(sizes)})"
                raise TaskError(f"the policy {self._path} observes {size} numbers of '{group}'; '{env.name}' {here}")
        for name, shape in about.images.items():
            there = env.image_shapes.get(name)
            if there != shape:
                here = "does not show it" if there is None else f"shows {there[1]} x {there[0]}"
                raise TaskError(
                    f"the policy {self._path} observes '{name}' of {shape[1]} x {shape[0]} pixels, '{env.name}' "
                    f"{here}: set task.images and world.cameras.CAMERA.size as they were when it was trained"
                )
        dt = env.engine.world.physics.control_dt
        if about.actions != env.action_dim or (about.control_dt and abs(about.control_dt - dt) > 1e-9):
            raise TaskError(
                f"the policy {self._path} gives {about.actions} numbers each {about.control_dt:g} s; '{env.name}' "
                f"takes {env.action_dim} each {dt:g} s"
            )
        return about

    def reset(self, env_ids: Array) -> None:
        """Nothing: it remembers nothing."""

    def act(self, obs: Obs, env_ids: Array) -> Array:
        """Actions (n, A), or chunks (n, K, A)."""
        images = list(self._about.images)
        hidden = [name for name in [*self._about.observations, *images] if name not in obs]
        if hidden:
            raise TaskError(f"the policy {self._path} observes {listing(hidden)}; --privileged shows it")
        rows: list[Any] = []
        for k in range(len(env_ids)):
            seen = {
                group: np.nan_to_num(obs[group][k : k + 1]).astype(np.float32) for group in self._about.observations
            }
            seen |= {name: np.ascontiguousarray(obs[name][k : k + 1]) for name in images}
            rows.append(self._run(seen)[0])
        given = np.array(rows, dtype=np.float64)
        if given.shape[-1] != self._dim or given.ndim not in (2, 3):
            raise TaskError(f"the policy {self._path} gave {given.shape[1:]} for an observation, not ({self._dim},)")
        return given


class ShippedEnvPolicy(FileEnvPolicy):
    """The policy file that comes with a task, which its key `shipped` names."""

    def __init__(self, env: TaskEnv) -> None:
        task = env.spec.task
        if task is None or task.shipped is None:
            raise TaskError(
                f"the policy 'shipped': no trained policy comes with '{env.name}'; train one with `anysim train`, "
                "evaluate it as --policy FILE.onnx, or name its file in task.shipped"
            )
        try:
            path = locate(task.shipped).path
        except AssetError as error:
            raise TaskError(f"the policy 'shipped' of '{env.name}', which task.shipped names: {error}") from None
        super().__init__(env, path=str(path))
