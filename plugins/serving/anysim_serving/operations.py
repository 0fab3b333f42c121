"""Operations of a session on its env: what each takes, does and answers. They run on the thread of the simulator."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine import arguments
from anysim.engine.snapshots.file import made_with
from anysim.errors import TaskError, listing
from anysim.math.arrays import shown, whole
from anysim.task.contract import STATUS_NAMES, Obs
from anysim.task.env import TaskEnv
from anysim.task.snapshot import EnvSnapshot, spec_hash
from anysim_client.errors import LimitExceeded, MalformedFrame
from anysim_client.messages import PROTOCOL, jpegs, snapshot_data, snapshot_of, step_chunk
from anysim_serving.settings import Limits

IMAGES = ("raw", "jpeg", "none")
"""Forms of images in an answer: arrays, JPEG of the colour images, or left out."""


# ---------------------------------------------------------------------------------------------- what a client must know


def handshake(env: TaskEnv, source: str) -> dict[str, Any]:
    """What a client knows of an env before it asks anything: versions, spaces and hashes."""
    spaces = {
        name: {"low": space.low, "high": space.high, "labels": list(space.labels), "start": space.start}
        for name, space in env.action_spaces.items()
    }
    low, high = env.action_bounds
    world = env.engine.world
    return {
        "protocol": PROTOCOL,
        "made_with": dict(made_with()),
        "task": env.name,
        "source": source,
        "num_envs": env.num_envs,
        "engine": env.engine.name,
        "engine_version": env.engine.version,
        "world": world.name,
        "world_hash": world.hash,
        "spec_hash": spec_hash(env.spec),
        "control_dt": world.physics.control_dt,
        "horizon": 0 if env.spec.task is None else env.spec.task.horizon,
        "cameras": [camera.name for camera in world.cameras],
        "action": {"low": low, "high": high, "channels": spaces},
        "observations": dict(env.observation_sizes),
        "images": {name: [list(shape), image_kind(name)] for name, shape in env.image_shapes.items()},
        "overridable": list(env.counterfactuals.paths),
        "spec": env.spec.to_dict(),
    }


def image_kind(name: str) -> str:
    """The type of an observed image."""
    return "<f4" if name.endswith("/depth") else "<i4" if name.endswith("/segmentation") else "|u1"


def details(env: TaskEnv) -> list[dict[str, Any]]:
    """Everything that is known of each env's episode now: words, draws, goals, poses and what sensors say."""
    everyone = np.arange(env.num_envs)
    sensed = env.sensor_rows(everyone)
    poses, entities = env.engine.get_state().body_pose, env.engine.world.entities
    streams, bindings, present = env.streams, env.bindings, env.engine.presence
    return [
        {
            "instruction": env.instruction(i),
            "status": str(env.status[i]),
            "held": int(env.mdp.held[i]),
            "draws": dict(streams.draws[i]),
            "overridden": dict(streams.overridden[i]),
            "bindings": {name: bindings.values[name][index[i]] for name, index in bindings.index.items()},
            "goals": {name: rows[i].copy() for name, rows in env.scene.goals.items()},
            "poses": {entity.name: poses[i, entity.root] for k, entity in enumerate(entities) if present[i, k]},
            "sensors": {name: rows[i] for name, rows in sensed.items()},
        }
        for i in everyone.tolist()
    ]


# ----------------------------------------------------------------------------------------------------------- operations


class Call(NamedTuple):
    """One operation: the env, what was sent, and what may be asked for."""

    env: TaskEnv
    message: Mapping[str, Any]
    limits: Limits

    def mask(self) -> Array | None:
        """`mask`, checked by the env."""
        return self.message.get("mask")


def _reset(call: Call) -> dict[str, Any]:
    m, env = call.message, call.env
    if m.get("pass_over"):  # a seed without an episode, as `env.streams.seed`
        ids = arguments.indices(m.get("env_ids", ()), env.num_envs, "env")
        env.streams.seed(m["seed"], ids)
        return _state(env)
    obs, _ = env.reset(
        seed=m.get("seed"), mask=call.mask(), episode_seeds=m.get("episode_seeds"), overrides=m.get("overrides")
    )
    return {"obs": obs, **_state(env)}


def _step(call: Call) -> dict[str, Any]:
    result = call.env.step(call.message.get("action"), call.mask())
    answer = {"obs": result.obs, "reward": result.reward, "code": _codes(result.status), "info": result.info}
    return answer | {"running": call.env.running}


def _chunk(call: Call) -> dict[str, Any]:
    actions = np.asarray(call.message.get("actions"))
    if actions.ndim == 3 and actions.shape[1] > call.limits.chunk:
        raise LimitExceeded(f"a chunk has at most {call.limits.chunk} steps, got {actions.shape[1]}; send several")
    chunk = step_chunk(call.env, actions)
    return {"reward": chunk.reward, "codes": _codes(chunk.status), "steps": chunk.steps, "obs": chunk.obs} | _state(
        call.env
    )


def _observe(call: Call) -> dict[str, Any]:
    obs, keys = call.env.obs, call.message.get("keys")
    if keys is not None:
        unknown = [key for key in keys if key not in obs] if isinstance(keys, list) else [keys]
        if unknown:
            raise TaskError(f"there is no observation {shown(unknown[0])} (there are: {listing(obs)})")
        obs = {key: obs[key] for key in keys}
    return {"obs": obs, **_state(call.env)}


def _snapshot(call: Call) -> dict[str, Any]:
    return {"snapshot": snapshot_data(call.env.snapshot(call.mask()))}


def _reset_to(call: Call) -> dict[str, Any]:
    m = call.message
    snapshot = m["file"] if isinstance(m.get("file"), EnvSnapshot) else snapshot_of(m.get("snapshot"))
    return {"obs": call.env.reset_to(snapshot, m.get("env_ids"), m.get("overrides")), **_state(call.env)}


def _render(call: Call) -> dict[str, Any]:
    env, m = call.env, call.message
    size = m.get("size") or (None, None)
    if not isinstance(size, list | tuple) or len(size) != 2:
        raise TaskError("size is a width and a height [px], such as [640, 480]")
    ids = m.get("env_ids")
    count = env.num_envs if ids is None else len(arguments.indices(ids, env.num_envs, "env"))
    width, height = (whole("size", side, TaskError, least=1) if side is not None else None for side in size)
    known = {camera.name: camera for camera in env.engine.world.cameras}
    camera = known.get(m.get("camera") or next(iter(known), ""))
    wide, high = width or (camera.width if camera else 1280), height or (camera.height if camera else 960)
    if count * wide * high > call.limits.pixels:
        raise LimitExceeded(
            f"one render has at most {call.limits.pixels} pixels, asked for {count} images of {wide}x{high}; "
            f"ask for fewer or smaller ones"
        )
    images = env.render(m.get("camera"), ids, size=(width, height), markers=bool(m.get("markers", True)))
    return {"images": images}


def _info(call: Call) -> dict[str, Any]:
    return {"details": details(call.env), **_state(call.env)}


def _retire(call: Call) -> dict[str, Any]:
    call.env.retire(arguments.indices(call.message.get("env_ids", ()), call.env.num_envs, "env"))
    return _state(call.env)


def _state(env: TaskEnv) -> dict[str, Any]:
    codes = _codes(env.status)
    return {"code": codes, "running": env.running, "info": env.info}


def _codes(words: Array) -> Array:
    return (words[..., None] == STATUS_NAMES).argmax(axis=-1).astype(np.int8)


OPERATIONS: Mapping[str, Callable[[Call], dict[str, Any]]] = {
    "reset": _reset,
    "step": _step,
    "step_chunk": _chunk,
    "observe": _observe,
    "snapshot": _snapshot,
    "reset_to": _reset_to,
    "render": _render,
    "info": _info,
    "retire": _retire,
}
"""By the word `op` of a message."""


def perform(env: TaskEnv, message: Mapping[str, Any], limits: Limits) -> dict[str, Any]:
    """Do what a message asks.

    Raises:
        MalformedFrame: there is no such operation.
        AnysimError: what the env says of it.
    """
    wanted = message.get("op")
    operation = OPERATIONS.get(wanted) if isinstance(wanted, str) else None
    if operation is None:
        raise MalformedFrame(f"there is no operation {shown(wanted)} (there are: {listing(OPERATIONS, 20)})")
    images = message.get("images", "raw")
    if images not in IMAGES:
        raise MalformedFrame(f"images are sent as {listing(IMAGES)}, not {shown(images)}")
    answer = operation(Call(env, message, limits))
    if message.get("full"):
        answer["details"] = details(env)
    if "obs" in answer and images != "raw" and env.image_shapes:
        answer["obs"] = in_form(answer["obs"], images, message.get("quality", 90))
    elif "images" in answer and images == "jpeg":
        answer["images"] = jpegs(answer["images"], message.get("quality", 90))
    return answer


# ------------------------------------------------------------------------------------------------------ forms of images


def in_form(obs: Obs, form: str, quality: Any) -> dict[str, Any]:
    """Observations with their images left out, or the colour images as JPEG."""
    if form == "none":
        return {name: rows for name, rows in obs.items() if not name.startswith("images/")}
    return {
        name: jpegs(rows, quality) if name.startswith("images/") and rows.dtype == np.uint8 else rows
        for name, rows in obs.items()
    }
