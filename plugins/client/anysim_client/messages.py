"""Contents of messages: chunks of steps, snapshots, and images, as both sides of the protocol read them."""

from collections.abc import Mapping
from io import BytesIO
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.snapshots.file import made_with
from anysim.engine.state import stamp_of, stamp_words, stamped
from anysim.errors import SnapshotError, TaskError
from anysim.math.arrays import whole
from anysim.task.contract import Obs
from anysim.task.env import TaskEnv
from anysim.task.snapshot import EnvSnapshot

PROTOCOL = 1
"""The version of the protocol; client and service must have the same."""


class Chunk(NamedTuple):
    """What several control steps in a row gave.

    Attributes:
        obs: after the last step that was made, as in `StepResult`.
        reward: (N, K) float32; 0 in steps that an env did not make.
        status: (N, K) words of `Status` after each step.
        info: after the last step.
        steps: (N,) control steps that each env made: one that ends is not stepped on.
    """

    obs: Obs
    reward: Array
    status: Array
    info: dict[str, Array]
    steps: Array


def step_chunk(env: TaskEnv, actions: Any) -> Chunk:
    """Steps of all envs with actions (N, K, A); envs that have ended wait for the others.

    Raises:
        TaskError: the actions have another shape, or no env is running.
    """
    actions = np.asarray(actions)
    if actions.ndim != 3 or actions.shape[::2] != (env.num_envs, env.action_dim) or not actions.shape[1]:
        raise TaskError(
            f"a chunk of actions has shape ({env.num_envs}, K, {env.action_dim}) with K >= 1, got {actions.shape}"
        )
    if not env.running.any():
        raise TaskError("no env is running; call reset() before step_chunk()")
    rewards = np.zeros(actions.shape[:2], dtype=np.float32)
    words = np.tile(env.status[:, None], (1, actions.shape[1]))
    steps = np.zeros(env.num_envs, dtype=np.int64)
    for k in range(actions.shape[1]):
        running = env.running
        if not running.any():
            break
        result = env.step(actions[:, k], None if running.all() else running)
        rewards[:, k] = result.reward
        words[:, k:] = result.status[:, None]
        steps += running
    return Chunk(env.obs, rewards, words, env.info, steps)


def snapshot_data(snapshot: EnvSnapshot) -> dict[str, Any]:
    """A snapshot as a message."""
    stamp = {"task": snapshot.task, "spec_hash": snapshot.spec_hash, **stamp_of(snapshot.engine)}
    data = {"engine": dict(snapshot.engine.data), "managers": snapshot.managers, "streams": snapshot.streams}
    return {"stamp": stamp, "made_with": dict(made_with()), "data": data}


def snapshot_of(message: Any) -> EnvSnapshot:
    """The snapshot of a message; `TaskEnv.reset_to` checks what is in it.

    Raises:
        SnapshotError: it is of another form, or was made with other versions.
    """
    try:
        stamp, data, versions = message["stamp"], message["data"], dict(message["made_with"])
        engine, managers, streams = stamped(stamp, data["engine"]), data["managers"], data["streams"]
        if not all(isinstance(rows, Mapping) for rows in (managers, streams, *managers.values())):
            raise TypeError
    except (KeyError, TypeError, ValueError, AttributeError):
        raise SnapshotError("the snapshot is damaged: it is no message of one; take a new one") from None
    if versions != dict(made_with()):
        raise SnapshotError(
            f"the snapshot was made with {versions}, the service has {dict(made_with())}, so going on from it would "
            f"not give the same bits; install the same versions on both sides"
        )
    return EnvSnapshot(engine, managers, streams, *stamp_words(stamp, "task", "spec_hash"))


def jpegs(images: Array, quality: Any) -> dict[str, Any]:
    """Images (N, H, W, 3) uint8 as JPEG, one after the other in `data`, each of `sizes` bytes."""
    from PIL import Image

    quality = whole("quality", quality, TaskError, least=1)
    if quality > 100:
        raise TaskError(f"quality is 1 to 100, got {quality}")
    parts: list[bytes] = []
    for image in images:
        buffer = BytesIO()
        Image.fromarray(image).save(buffer, "jpeg", quality=quality)
        parts.append(buffer.getvalue())
    data = np.frombuffer(b"".join(parts), dtype=np.uint8)
    return {"jpeg": data, "sizes": np.array([len(part) for part in parts], dtype=np.int64)}


def from_jpegs(packed: Mapping[str, Any]) -> Array:
    """Images (N, H, W, 3) uint8 of what `jpegs` gave."""
    from PIL import Image

    data, ends = packed["jpeg"].tobytes(), np.cumsum(packed["sizes"])
    starts = ends - packed["sizes"]
    return np.stack(
        [
            np.asarray(Image.open(BytesIO(data[a:b]), formats=("JPEG",)))
            for a, b in zip(starts.tolist(), ends.tolist(), strict=True)
        ]
    )
