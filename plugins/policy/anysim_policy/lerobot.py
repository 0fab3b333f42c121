"""LeRobot's policies, run in this process: one env after another, as LeRobot itself runs them."""

import copy
from itertools import chain
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import TaskError, listing
from anysim.task.contract import Obs
from anysim.task.env import TaskEnv
from anysim_policy.lerobot_files import load_directory
from anysim_policy.names import named

STATE, PRIVILEGED, IMAGES = "observation.state", "observation.environment_state", "observation.images."
_MOST_SEED = 2**63 - 1


class LeRobotEnvPolicy:
    """A directory of LeRobot's `save_pretrained`, with the scales of observations and actions that it was saved with.

    A policy of chunks that sees one observation is asked for a chunk; any other is asked in each step, so that it can
    remember what it saw. Each env has a copy of what the policy remembers (not of its weights), and its draws are those
    of the episode: envs do not depend on each other.

    Attributes:
        version: of all files of the directory: the digest of their bytes.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        path: Annotated[str, Field(description="the directory with config.json and model.safetensors")],
        keys: Annotated[
            str, Field(description="its inputs: FEATURE:OURS, joined by +; the others by their names")
        ] = "",
        steps: Annotated[int, Field(ge=0, description="steps of a chunk to carry out; 0: as it says itself")] = 0,
        device: Annotated[str, Field(description="where it is run: cpu, cuda")] = "cpu",
    ) -> None:
        self._env, self._path = env, path
        self._loaded = load_directory(Path(path), device)
        self.version, config = self._loaded.version, self._loaded.config
        self._inputs = self._mapped(keys)
        self._check_actions()
        size = getattr(config, "chunk_size", None)
        remembers = (
            getattr(config, "n_obs_steps", 1) > 1 or getattr(config, "temporal_ensemble_coeff", None) is not None
        )
        self._steps = 0 if size is None or remembers else steps or int(config.n_action_steps)
        if steps and not self._steps:
            raise TaskError(f"policy.steps: the policy {path} ({config.type}) is asked in each step; leave it out")
        if self._steps > (size or 0):
            raise TaskError(f"policy.steps: the policy {path} gives chunks of {size} steps, fewer than {self._steps}")
        self._own: dict[int, Any] = {}

    def _mapped(self, keys: str) -> dict[str, str]:
        """Our names of observations by the policy's; raises TaskError unless they are there in the same shapes."""
        env, features = self._env, self._loaded.config.input_features
        known = [*env.observation_sizes, *env.image_shapes]
        given = named(keys, known, env.name, STATE)
        usual = {STATE: "policy", PRIVILEGED: "privileged"}
        if other := [name for name in given if name not in features]:
            raise TaskError(
                f"policy.keys: the policy {self._path} does not take {listing(other)}, but {listing(features)}"
            )
        found: dict[str, str] = {}
        for name, feature in features.items():
            ours = given.get(name) or usual.get(name) or name.replace(IMAGES, "images/")
            if ours not in known:
                raise TaskError(
                    f"the policy {self._path} observes '{name}'; '{env.name}' has no '{ours}' (observations: "
                    f"{listing(known, 20)}): say which it is with keys={name}:OURS, or show an image with "
                    "`-o 'task.images={CAMERA: {}}'`"
                )
            here = (env.observation_sizes[ours],) if ours in env.observation_sizes else env.image_shapes[ours]
            here = (here[2], *here[:2]) if len(here) == 3 else here
            if tuple(feature.shape) != here:
                raise TaskError(
                    f"the policy {self._path} observes '{name}' of shape {tuple(feature.shape)}; '{ours}' of "
                    f"'{env.name}' is {here}: set world.cameras.NAME.size, or map another with keys={name}:OURS"
                )
            found[name] = ours
        return found

    def _check_actions(self) -> None:
        feature = self._loaded.config.action_feature
        shape = None if feature is None else tuple(feature.shape)
        if shape != (self._env.action_dim,):
            raise TaskError(
                f"the policy {self._path} gives actions of shape {shape}; '{self._env.name}' takes "
                f"({self._env.action_dim},): {listing(map(str, self._env.action_spaces.labels), 20)}"
            )

    def reset(self, env_ids: Array) -> None:
        """Forget what was seen in these envs."""
        for i in env_ids.tolist():
            self._of(i).reset()

    def act(self, obs: Obs, env_ids: Array) -> Array:
        """Chunks (n, K, A); of one action where the policy remembers."""
        if hidden := [ours for ours in self._inputs.values() if ours not in obs]:
            raise TaskError(f"the policy {self._path} observes {listing(hidden)}; --privileged shows it")
        return np.stack([self._chunk(obs, row, env) for row, env in enumerate(env_ids.tolist())])

    def _of(self, env: int) -> Any:
        """The policy of an env: its memory is its own, its weights are those of all."""
        if env not in self._own:
            shared = self._loaded.policy
            weights = {id(tensor): tensor for tensor in chain(shared.parameters(), shared.buffers())}
            self._own[env] = copy.deepcopy(shared, weights)
        return self._own[env]

    def _chunk(self, obs: Obs, row: int, env: int) -> Array:
        """(K, A) for an env, whose observation is a row of `obs`."""
        import torch  # pyright: ignore[reportMissingImports]

        seen: dict[str, Any] = {"task": [self._env.instruction(env)]}
        for theirs, ours in self._inputs.items():
            value = np.nan_to_num(obs[ours][row : row + 1]).astype(np.float32)
            value = np.moveaxis(value, -1, 1) / np.float32(255.0) if value.ndim == 4 else value
            seen[theirs] = torch.from_numpy(np.ascontiguousarray(value))
        draws = self._env.streams.generator(env, "policy/lerobot", int(self._env.scene.elapsed[env]))
        with torch.random.fork_rng(devices=[]), torch.no_grad():
            torch.manual_seed(int(draws.integers(_MOST_SEED)))
            policy, ready = self._of(env), self._loaded.before(seen)
            if self._steps:
                actions = policy.predict_action_chunk(ready)[0, : self._steps]
            else:
                actions = policy.select_action(ready)
            given = self._loaded.after(actions).to("cpu").numpy().astype(np.float64)
        if given.ndim != 2 or given.shape[1] != self._env.action_dim or not np.isfinite(given).all():
            raise TaskError(
                f"the policy {self._path} gave {given.shape}, or numbers that are not finite, for an action"
            )
        return given
