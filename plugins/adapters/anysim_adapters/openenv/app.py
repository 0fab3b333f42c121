"""Application that speaks OpenEnv's protocol: a WebSocket is a session with one env, and all that travels is JSON."""

import asyncio
import base64
import json
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from io import BytesIO
from typing import Any

import numpy as np
from fastapi import FastAPI, WebSocket, WebSocketDisconnect

from anysim import __version__
from anysim.conventions import Array
from anysim.errors import AnysimError, TaskError, listing
from anysim.math.arrays import numbers, shown, whole
from anysim.record.json import plain
from anysim.task.env import TaskEnv
from anysim_client.errors import LimitExceeded, ServiceError
from anysim_serving.catalogue import Catalogue, SessionRequest
from anysim_serving.sessions import Session, Sessions
from anysim_serving.settings import Settings

SWEEP_S = 1.0
EPISODE = ("seed", "episode_id")
"""What `reset` takes: the seed of the episode, and a name for it that `state` gives back."""


def application(catalogue: Catalogue, settings: Settings) -> FastAPI:
    """The application, without the checks of `anysim_serving.access.Gate` before it."""
    sessions = Sessions(catalogue, settings.limits)

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        sweeper = asyncio.create_task(_sweep(sessions))
        try:
            yield
        finally:
            sweeper.cancel()
            await sessions.close(lambda *_: None)

    app = FastAPI(title="anysim", version=__version__, lifespan=lifespan, docs_url=None, redoc_url=None)
    app.state.sessions = sessions

    @app.get("/health")
    async def health() -> dict[str, str]:
        return {"status": "healthy"}

    @app.get("/metadata")
    async def metadata() -> dict[str, str]:
        name = catalogue.default
        return {"name": name, "description": f"The task {name} of anysim.", "version": __version__}

    @app.get("/schema")
    async def schema() -> dict[str, Any]:
        """What `step` takes and gives, in words of JSON Schema; the number of numbers is that of `state`."""
        row = {"type": "array", "items": {"type": "number"}}
        return {
            "action": {"type": "object", "properties": {"action": row}, "required": ["action"]},
            "observation": {"type": "object", "additionalProperties": True},
            "state": {"type": "object", "properties": {"step_count": {"type": "integer"}}},
        }

    @app.websocket("/ws")
    async def socket(websocket: WebSocket) -> None:
        await websocket.accept()
        try:
            request = SessionRequest(num_envs=1)
            session = await sessions.create(request)
        except AnysimError as error:
            full = isinstance(error, LimitExceeded)
            await _send(websocket, "error", _fault(error, "CAPACITY_REACHED" if full else "FACTORY_ERROR"))
            await websocket.close()
            return
        try:
            await _talk(websocket, sessions, session)
        except WebSocketDisconnect:
            pass
        finally:
            sessions.end(session, "by_client")

    return app


async def _sweep(sessions: Sessions) -> None:
    while True:
        await asyncio.sleep(SWEEP_S)
        sessions.sweep()


async def _talk(websocket: WebSocket, sessions: Sessions, session: Session) -> None:
    episode = Episode()
    while True:
        text = await websocket.receive_text()
        session.counts["operations"] += 1
        try:
            message = json.loads(text)
            kind, data = message["type"], message.get("data") or {}
            if not isinstance(data, dict):
                raise TypeError
        except (ValueError, TypeError, KeyError, RecursionError):
            await _send(websocket, "error", _fault("a message is a JSON object with `type` and `data`", "INVALID_JSON"))
            continue
        if kind == "close":
            await websocket.close()
            return
        job = {"reset": episode.reset, "step": episode.step, "state": episode.state}.get(kind)
        if job is None:
            words = f"there is no message '{str(kind)[:60]}' (messages: reset, step, state, close)"
            await _send(websocket, "error", _fault(words, "UNKNOWN_TYPE"))
            continue
        try:
            answer = await sessions.do(session, lambda env, job=job, data=data: job(env, data))
        except TaskError as error:
            await _send(websocket, "error", _fault(error, "VALIDATION_ERROR"))
        except ServiceError as error:
            await _send(websocket, "error", _fault(error, "SESSION_ERROR"))
        except AnysimError as error:
            await _send(websocket, "error", _fault(error, "EXECUTION_ERROR"))
        else:
            await _send(websocket, "state" if kind == "state" else "observation", answer)


async def _send(websocket: WebSocket, kind: str, data: Mapping[str, Any]) -> None:
    await websocket.send_text(json.dumps({"type": kind, "data": plain(dict(data), "the answer")}))


def _fault(error: object, code: str) -> dict[str, Any]:
    return {"message": str(error), "code": code}


class Episode:
    """The episode of a session: what a client may ask, and its answers."""

    def __init__(self) -> None:
        self._name: str | None = None
        self._begun, self._ended = False, True

    def reset(self, env: TaskEnv, data: dict[str, Any]) -> dict[str, Any]:
        """Begin an episode; `seed` makes it that one."""
        unknown = [key for key in data if key not in EPISODE]
        if unknown:
            raise TaskError(f"reset takes {listing(EPISODE)}, got {listing(unknown)}")
        seed, name = data.get("seed"), data.get("episode_id")
        if name is not None and not (isinstance(name, str) and len(name) <= 200):
            raise TaskError("episode_id is a text of at most 200 letters")
        env.reset(seed=None if seed is None else [whole("seed", seed, TaskError)])
        self._name, self._begun, self._ended = name, True, False
        return {"observation": _observation(env), "reward": None, "done": False, "metadata": _told(env)}

    def step(self, env: TaskEnv, data: dict[str, Any]) -> dict[str, Any]:
        """One control step by `action`, as many numbers as the task takes."""
        if self._ended:
            raise TaskError("the episode has ended, or none has begun; send reset first")
        given = numbers("action", data.get("action"), TaskError)
        if set(data) - {"action", "metadata"} or given.shape != (env.action_dim,) or not np.isfinite(given).all():
            raise TaskError(f"step takes `action`, {env.action_dim} finite numbers, got {shown(data)}")
        result = env.step(given[None])
        terminated, truncated = bool(result.terminated[0]), bool(result.truncated[0])
        self._ended = terminated or truncated
        return {
            "observation": _observation(env),
            "reward": float(result.reward[0]),
            "done": self._ended,
            "metadata": {**_told(env), "terminated": terminated, "truncated": truncated},
        }

    def state(self, env: TaskEnv, _: dict[str, Any]) -> dict[str, Any]:
        """What the episode is."""
        low, high = env.action_bounds
        return {
            "episode_id": self._name,
            "step_count": int(env.info["elapsed_steps"][0]) if self._begun else 0,
            "task": env.name,
            "status": str(env.status[0]),
            "action": {"names": list(env.action_spaces.labels), "low": low, "high": high},
        }


def _told(env: TaskEnv) -> dict[str, Any]:
    return {"status": str(env.status[0]), "episode_seed": int(env.info["episode_seed"][0])}


def _observation(env: TaskEnv) -> dict[str, Any]:
    """The groups that a policy may see as lists, images as PNG in base64, and the instruction."""
    seen: dict[str, Any] = {"instruction": env.instruction(0)}
    for name, rows in env.obs.items():
        if name in env.image_shapes:
            seen[name] = _image(rows[0])
        elif name != "privileged":
            seen[name] = np.nan_to_num(rows[0]).tolist()
    return seen


def _image(image: Array) -> dict[str, Any]:
    """Colours as PNG; other channels as their bytes in C order."""
    about = {"shape": list(image.shape), "dtype": image.dtype.str}
    if image.dtype == np.uint8 and image.ndim == 3:
        from PIL import Image

        file = BytesIO()
        Image.fromarray(image).save(file, "PNG")
        return {**about, "encoding": "png", "data": base64.b64encode(file.getvalue()).decode()}
    data = np.ascontiguousarray(image).tobytes()
    return {**about, "encoding": "raw", "data": base64.b64encode(data).decode()}
