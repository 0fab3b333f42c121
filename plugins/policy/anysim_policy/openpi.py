"""Policies behind a WebSocket server that speaks openpi's protocol, asked for one env after another."""

import math
import os
import weakref
from contextlib import ExitStack, suppress
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import PluginError, TaskError, listing
from anysim.task.contract import Obs
from anysim.task.env import TaskEnv
from anysim_policy.names import named

KEY_ENV = "ANYSIM_POLICY_KEY"
"""The environment variable with the key of a server that asks for one."""
MESSAGE_BYTES = 64 << 20
"""The longest answer that is read."""
PROMPT = "prompt"
"""The key of the task in words."""


class OpenPiEnvPolicy:
    """Sends an env's observation, and gets a chunk of actions (K, A) in the env's units under the key `actions`.

    Observations travel one env at a time: groups (D,) float32, images (H, W, 3) uint8, and the env's instruction. What
    is not a number is sent as 0, as to learners. The protocol knows no episodes: `reset` tells the server nothing.

    Attributes:
        metadata: what the server said of itself when it was connected.
        version: the same in a text, so that episodes of another policy are not mixed in.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        url: Annotated[str, Field(description="address of the server, as ws://127.0.0.1:8000")],
        keys: Annotated[str, Field(description="names to send under: THEIRS:OURS, joined by +; empty: ours")] = "",
        steps: Annotated[int, Field(ge=0, description="steps of a chunk to carry out before asking; 0: all")] = 0,
        timeout: Annotated[float, Field(gt=0, description="longest time that an answer may take [s]")] = 60.0,
    ) -> None:
        try:
            from websockets.exceptions import WebSocketException
            from websockets.sync.client import connect
        except ImportError as error:
            raise PluginError(
                f"policy servers need websockets ({error}): pip install 'anysim-policy[openpi]'"
            ) from None
        from anysim_policy import openpi_wire

        self._wire, self._failures = openpi_wire, (WebSocketException, OSError, EOFError)
        self._env, self._url, self._steps, self._timeout = env, url, steps, timeout
        self._keys = self._named(keys)
        if not math.isfinite(timeout):
            raise TaskError(f"policy.timeout: expected a number of seconds, got {timeout}")
        self._open = ExitStack()
        key = os.environ.get(KEY_ENV)
        heads = {"Authorization": f"Api-Key {key}"} if key else None
        try:
            self._socket = self._open.enter_context(
                connect(
                    url,
                    compression=None,
                    max_size=MESSAGE_BYTES,
                    open_timeout=timeout,
                    close_timeout=1.0,
                    additional_headers=heads,
                )
            )
        except (*self._failures, ValueError) as error:
            raise TaskError(
                f"the policy server {url} cannot be reached ({_words(error)}); start it, or mend the address, or "
                f"give its key in {KEY_ENV}"
            ) from error
        weakref.finalize(self, self._open.close)
        try:
            self.metadata = self._receive()
        except TaskError:
            self.close()
            raise
        self.version = f"{url} {self.metadata!r}"

    def _named(self, text: str) -> dict[str, str]:
        """Our names of observations by the server's."""
        known = [*self._env.observation_sizes, *self._env.image_shapes]
        if not text:
            return {name: name for name in known if name != "privileged"}
        pairs = named(text, known, self._env.name, "observation/state")
        if PROMPT in pairs:
            raise TaskError(
                f"policy.keys: '{PROMPT}' is the task in words, so no observation has this name; got {text}"
            )
        return pairs

    def reset(self, env_ids: Array) -> None:
        """Nothing: the server is not told of episodes."""

    def act(self, obs: Obs, env_ids: Array) -> Array:
        """Chunks (n, K, A)."""
        hidden = [name for name in self._keys.values() if name not in obs]
        if hidden:
            raise TaskError(f"the policy server {self._url} is to be sent {listing(hidden)}; --privileged shows it")
        chunks = [self._ask(obs, row, env) for row, env in enumerate(env_ids.tolist())]
        lengths = sorted({len(chunk) for chunk in chunks})
        if len(lengths) > 1:
            raise TaskError(
                f"the policy server {self._url} gave chunks of {listing(map(str, lengths))} steps at once; expected "
                f"one length for all envs, which steps={lengths[0]} makes"
            )
        return np.stack(chunks)

    def close(self) -> None:
        """Hang up. A policy that is no longer used does so by itself."""
        self._open.close()

    def _ask(self, obs: Obs, row: int, env: int) -> Array:
        """The chunk (K, A) for an env, whose observation is a row of `obs`."""
        seen: dict[str, Any] = {PROMPT: self._env.instruction(env)}
        for theirs, ours in self._keys.items():
            value = np.ascontiguousarray(obs[ours][row])
            seen[theirs] = np.nan_to_num(value).astype(np.float32) if value.dtype.kind == "f" else value
        try:
            self._socket.send(self._wire.pack(seen))
        except self._failures as error:
            raise self._gone(error) from error
        answer = self._receive()
        given = answer.get("actions")
        dim = self._env.action_dim
        if not isinstance(given, np.ndarray) or given.ndim not in (1, 2) or given.shape[-1] != dim or given.size == 0:
            found = given.shape if isinstance(given, np.ndarray) else f"none under 'actions' ({listing(answer)})"
            raise TaskError(
                f"the policy server {self._url} gave actions {found}; '{self._env.name}' takes ({dim},) or (K, {dim})"
            )
        chunk = given.reshape(-1, dim).astype(np.float64)
        if not np.isfinite(chunk).all():
            raise TaskError(f"the policy server {self._url} gave actions that are no finite numbers")
        return chunk[: self._steps or None]

    def _receive(self) -> dict[str, Any]:
        try:
            data = self._socket.recv(timeout=self._timeout)
        except TimeoutError:
            self.close()
            raise TaskError(
                f"the policy server {self._url} gave no answer within {self._timeout:g} s; its log says why, or allow "
                "more: timeout=SECONDS"
            ) from None
        except self._failures as error:
            raise self._gone(error) from error
        if isinstance(data, str):
            with suppress(*self._failures):
                self.close()
            lines = data.strip().splitlines() or ["no reason given"]
            raise TaskError(f"the policy server {self._url} failed: {lines[-1]}")
        try:
            message = self._wire.unpack(data)
            if not isinstance(message, dict):
                raise ValueError(f"a {type(message).__name__}, not a map")
        except ValueError as error:
            raise TaskError(f"{self._url} does not speak openpi's protocol: it sent {error}") from None
        return {str(key): value for key, value in message.items()}

    def _gone(self, error: Exception) -> TaskError:
        return TaskError(
            f"the policy server {self._url} is gone ({_words(error)}); start it, then the same command goes on"
        )


def _words(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return lines[0] if lines else type(error).__name__
