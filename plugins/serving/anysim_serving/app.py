"""Application of a service: its HTTP, and the socket of each session."""

import asyncio
import logging
import tempfile
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Annotated, Any

from fastapi import Body, Depends, FastAPI, Header, Request, Response, WebSocket
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from fastapi.security import HTTPBearer
from pydantic import ConfigDict, Field
from starlette.exceptions import HTTPException

from anysim import __version__
from anysim.errors import AnysimError
from anysim.record.json import plain
from anysim.task.snapshot import EnvSnapshot
from anysim_client.errors import MalformedFrame, ServiceError, to_data
from anysim_client.messages import PROTOCOL
from anysim_schemas.base import Spec
from anysim_serving.catalogue import Catalogue, SessionRequest
from anysim_serving.metrics import exposition
from anysim_serving.operations import perform
from anysim_serving.sessions import Session, Sessions
from anysim_serving.settings import Settings
from anysim_serving.socket import serve_socket

_log = logging.getLogger(__name__)
SWEEP_S = 1.0
KEY = "anysim-session-key"
Key = Annotated[str, Header(alias=KEY, max_length=100, description="What `POST /v1/sessions` gave its client.")]
Envs = Annotated[list[Annotated[int, Field(ge=0)]], Field(max_length=65536)]
_SHOWN = 1 << 16
"""Numbers of one array that JSON shows; larger ones are for the socket."""


class ResetRequest(Spec):
    """What begins new episodes, as `TaskEnv.reset` takes it."""

    model_config = ConfigDict(defer_build=False)  # what FastAPI builds schemas from

    seed: Annotated[int, Field(ge=0)] | Envs | None = None
    env_ids: Envs | None = None
    episode_seeds: Envs | None = None
    overrides: dict[str, Any] | list[dict[str, Any]] | None = None


async def _owned(request: Request, session: str, key: Key = "") -> Session:
    return request.app.state.sessions.owned(session, key)


Owned = Annotated[Session, Depends(_owned)]


def application(catalogue: Catalogue, settings: Settings) -> FastAPI:
    """The application, without the checks of `access.Gate` before it; `app.state.sessions` are its sessions."""
    sessions = Sessions(catalogue, settings.limits)
    began = time.monotonic()

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        sweeper = asyncio.create_task(_sweep(sessions))
        try:
            yield
        finally:
            sweeper.cancel()
            await sessions.close(_log.warning)

    app = FastAPI(
        title="anysim",
        version=__version__,
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
        openapi_url="/openapi.json",
        dependencies=[Depends(HTTPBearer(auto_error=False))],
        summary="Envs of tasks and worlds. Steps go over the socket of a session: see docs/serve.md.",
    )
    app.state.sessions = sessions
    _answer_errors(app)

    @app.get("/v1/health")
    async def health() -> dict[str, Any]:
        """Whether it is well, and since when."""
        up = round(time.monotonic() - began, 3)
        return {
            "status": "ok",
            "version": __version__,
            "protocol": PROTOCOL,
            "up_s": up,
            "sessions": len(sessions.open),
        }

    @app.get("/v1/catalogue")
    async def catalogue_of() -> dict[str, Any]:
        """What may be asked for, and the most of it."""
        return {**catalogue.about(), "limits": vars(settings.limits)}

    @app.get("/v1/metrics")
    async def metrics() -> Response:
        """Counts in the text format of Prometheus."""
        return Response(exposition(sessions), media_type="text/plain; version=0.0.4")

    @app.get("/v1/sessions")
    async def list_sessions() -> list[dict[str, Any]]:
        """All sessions, without their keys."""
        return [session.about() for session in sessions.open.values()]

    @app.post("/v1/sessions", status_code=201)
    async def create(request: SessionRequest) -> Response:
        """A session: its `id`, the `key` that it answers to, and the `spec` of its env."""
        session = await sessions.create(request)
        return _json({"id": session.id, "key": session.key, "spec": session.spec}, 201)

    @app.get("/v1/sessions/{session}")
    async def about(session: Owned) -> dict[str, Any]:
        """What is counted of a session."""
        return session.about()

    @app.get("/v1/sessions/{session}/spec")
    async def spec(session: Owned) -> Response:
        """The handshake: versions, spaces and hashes."""
        return _json(session.spec)

    @app.delete("/v1/sessions/{session}", status_code=204)
    async def end(session: Owned) -> None:
        """End a session and free its env."""
        sessions.end(session, "by_client")

    async def ask(session: Session, message: dict[str, Any]) -> dict[str, Any]:
        session.counts["operations"] += 1
        return await sessions.do(session, lambda env: perform(env, message, settings.limits))

    @app.get("/v1/sessions/{session}/info")
    async def info(session: Owned) -> Response:
        """Everything that is known of the episodes now: words, draws, goals, poses, sensors."""
        return _json(await ask(session, {"op": "info"}))

    @app.post("/v1/sessions/{session}/reset")
    async def reset(session: Owned, request: ResetRequest) -> Response:
        """Begin episodes, in all envs or in `env_ids`; the answer has numbers and no images."""
        message: dict[str, Any] = {"op": "reset", "images": "none", **request.model_dump(exclude={"env_ids"})}
        if request.env_ids is not None:
            import numpy as np

            chosen = np.zeros(session.num_envs, dtype=bool)
            if any(env >= session.num_envs for env in request.env_ids):
                raise ServiceError(f"the session has envs 0 to {session.num_envs - 1}, got {request.env_ids[:8]}")
            chosen[request.env_ids] = True
            message["mask"] = chosen
        return _json(await ask(session, message))

    @app.post("/v1/sessions/{session}/snapshot")
    async def snapshot(session: Owned) -> Response:
        """The envs at this moment, as the file that `EnvSnapshot.load` reads."""
        session.counts["operations"] += 1
        content = await sessions.do(session, lambda env: _as_file(env.snapshot()))
        return Response(content, media_type="application/octet-stream")

    @app.post("/v1/sessions/{session}/reset_to")
    async def reset_to(session: Owned, file: Annotated[bytes, Body(media_type="application/octet-stream")]) -> Response:
        """Put the envs of such a file into the session's."""
        loaded = await asyncio.to_thread(_from_file, file)
        return _json(await ask(session, {"op": "reset_to", "file": loaded, "images": "none"}))

    @app.websocket("/v1/sessions/{session}/socket")
    async def socket(websocket: WebSocket, session: str) -> None:
        await serve_socket(websocket, sessions, session, websocket.headers.get(KEY, ""))

    return app


async def _sweep(sessions: Sessions) -> None:
    while True:
        await asyncio.sleep(SWEEP_S)
        try:
            sessions.sweep()
        except Exception:  # noqa: BLE001 - the next one may succeed
            _log.exception("a sweep over the sessions failed")


def _answer_errors(app: FastAPI) -> None:
    async def known(_: Request, error: Exception) -> Response:
        data = to_data(error)
        return JSONResponse({"error": data}, data["status"])

    async def invalid(_: Request, error: Exception) -> Response:
        issues = error.errors() if isinstance(error, RequestValidationError) else []
        words = "; ".join(f"{'.'.join(map(str, issue['loc']))}: {issue['msg']}" for issue in issues[:8])
        return JSONResponse({"error": {"type": "ServiceError", "message": words, "status": 422}}, 422)

    async def plain_http(_: Request, error: Exception) -> Response:
        assert isinstance(error, HTTPException)
        if isinstance(error.__cause__, ServiceError):  # raised while the body was read
            return await known(_, error.__cause__)
        told = {"type": "ServiceError", "message": str(error.detail), "status": error.status_code}
        return JSONResponse({"error": told}, error.status_code)

    async def broken(_: Request, error: Exception) -> Response:
        _log.error("a request failed", exc_info=error)
        return JSONResponse({"error": to_data(error)}, 500)

    app.add_exception_handler(AnysimError, known)
    app.add_exception_handler(RequestValidationError, invalid)
    app.add_exception_handler(HTTPException, plain_http)
    app.add_exception_handler(Exception, broken)


def _json(data: Any, status: int = 200) -> Response:
    return JSONResponse(plain(_shown(data), "the answer"), status)


def _shown(value: Any) -> Any:
    """The answer, with large arrays as a sentence."""
    import numpy as np

    if isinstance(value, np.ndarray) and value.size > _SHOWN:
        return f"an array {value.shape} of {value.dtype}; ask for it on the socket"
    if isinstance(value, dict):
        return {key: _shown(item) for key, item in value.items()}
    return [_shown(item) for item in value] if isinstance(value, list) else value


def _as_file(snapshot: EnvSnapshot) -> bytes:
    with tempfile.TemporaryDirectory(prefix="anysim-") as folder:
        return snapshot.save(Path(folder) / "envs").read_bytes()


def _from_file(content: bytes) -> EnvSnapshot:
    if not content:
        raise MalformedFrame("the body is the file of a snapshot; none was sent")
    with tempfile.TemporaryDirectory(prefix="anysim-") as folder:
        path = Path(folder) / "snapshot"
        path.write_bytes(content)
        try:
            return EnvSnapshot.load(path)
        except AnysimError as error:
            raise type(error)(str(error).replace(str(path), "the file that was sent")) from None
