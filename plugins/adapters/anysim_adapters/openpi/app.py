"""Application that speaks openpi's protocol: it greets with metadata, then answers each observation with actions."""

import asyncio
import logging
import time
from collections.abc import AsyncIterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from typing import Any

from fastapi import FastAPI, Response, WebSocket, WebSocketDisconnect

from anysim import __version__
from anysim.errors import AnysimError
from anysim_adapters.openpi.host import PolicyHost
from anysim_policy import openpi_wire

FULL = 503


def application(host: PolicyHost) -> FastAPI:
    """The application, without the checks of `anysim_serving.access.Gate` before it."""
    # one thread asks the policy: it needs no locks, and clients wait their turn
    asking = ThreadPoolExecutor(1, "anysim policy")
    free = list(range(host.clients))[::-1]

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        yield
        asking.shutdown()

    app = FastAPI(title="anysim", version=__version__, lifespan=lifespan, docs_url=None, redoc_url=None)

    @app.get("/healthz")
    async def health() -> Response:
        return Response("OK\n", media_type="text/plain")

    @app.websocket("/")
    async def socket(websocket: WebSocket) -> None:
        if not free:
            words = f"all {host.clients} clients of this policy server are there; ask again when one has gone\n"
            await websocket.send_denial_response(Response(words, FULL, media_type="text/plain"))
            return
        client = free.pop()
        try:
            await websocket.accept()
            await _in(asking, host.begin, client)
            await websocket.send_bytes(openpi_wire.pack(host.metadata))
            await _talk(websocket, asking, host, client)
        except WebSocketDisconnect:
            pass
        finally:
            free.append(client)

    return app


async def _in(asking: ThreadPoolExecutor, job: Any, *given: Any) -> Any:
    return await asyncio.get_running_loop().run_in_executor(asking, job, *given)


async def _talk(websocket: WebSocket, asking: ThreadPoolExecutor, host: PolicyHost, client: int) -> None:
    """Answer until the client goes. What is wrong with a message is told as text, and the next one is awaited."""
    while True:
        message = await websocket.receive()
        if message["type"] == "websocket.disconnect":
            return
        began = time.perf_counter()
        try:
            seen = _read(message)
            actions = await _in(asking, host.infer, client, seen)
        except (AnysimError, ValueError) as error:
            await websocket.send_text(str(error))
            continue
        except Exception:  # of the policy, which is anybody's code: its words may hold paths
            logging.getLogger(__name__).exception("the policy failed")
            await websocket.send_text("the policy failed; the log of its server says why")
            continue
        timing = {"infer_ms": (time.perf_counter() - began) * 1e3}
        await websocket.send_bytes(openpi_wire.pack({"actions": actions, "server_timing": timing}))


def _read(message: Any) -> dict[Any, Any]:
    data = message.get("bytes")
    if data is None:
        raise ValueError("an observation is a binary message, a msgpack map with arrays")
    seen = openpi_wire.unpack(data)
    if not isinstance(seen, dict):
        raise ValueError(f"an observation is a map of names to arrays, got a {type(seen).__name__}")
    return seen
