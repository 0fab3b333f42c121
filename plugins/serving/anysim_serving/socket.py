"""Socket of a session: messages in, answers out, in their order, while the simulator works.

A message is unpacked, done and packed on the thread of the simulator, so that a large one holds up nobody else. The
reader takes the next message while one is worked on; more than `Limits.waiting` are answered as busy. A client that
does not read its answers stops its own session and no other: then no more of it is read.
"""

import asyncio
import logging
from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any

from fastapi import WebSocket
from starlette.responses import JSONResponse
from starlette.websockets import WebSocketDisconnect

from anysim.errors import AnysimError
from anysim.task.env import TaskEnv
from anysim_client import wire
from anysim_client.errors import MalformedFrame, ServiceBusy, ServiceError, status_of, to_data
from anysim_serving.operations import perform
from anysim_serving.sessions import Session, Sessions
from anysim_serving.shared import Offer

_log = logging.getLogger(__name__)
WITHOUT_ANSWER = 64
"""Answers that may wait for a client to read them; then no more is read of it."""
SEND_S = 60.0
"""How long one message of an answer may take to be read [s]; then the client is taken for gone."""
_IDLE_CLOSE = 4408
Frame = list[wire.Part]


@dataclass
class _Link:
    """What a connection keeps beside its session: the memory that it shares, if it does."""

    session: Session
    shared: Offer | None = None
    offered: Offer | None = None
    ahead: int = 0
    """Messages that were read and not answered yet."""
    answers: "asyncio.Queue[Future[Any] | Frame | None]" = field(default_factory=lambda: asyncio.Queue(WITHOUT_ANSWER))


async def serve_socket(websocket: WebSocket, sessions: Sessions, ident: str, key: str) -> None:
    """Serve the connection of a session until it ends; whatever ends it, the session is free again."""
    try:
        session = sessions.owned(ident, key)
        sessions.attach(session)
    except ServiceError as error:
        await websocket.receive()
        await websocket.send_denial_response(JSONResponse({"error": to_data(error)}, error.status))
        return
    link = _Link(session)
    try:
        await websocket.accept()
        reader = asyncio.create_task(_read(websocket, sessions, link))
        writer = asyncio.create_task(_write(websocket, sessions, link))
        gone = asyncio.create_task(_ended(session))
        _, running = await asyncio.wait((reader, writer, gone), return_when=asyncio.FIRST_COMPLETED)
        if reader.done() and not writer.done() and not gone.done():
            await link.answers.put(None)
        for task in running:
            task.cancel()
        await asyncio.gather(*running, return_exceptions=True)
        if gone.done() and not gone.cancelled():
            await websocket.close(_IDLE_CLOSE, "the session has ended")
    except (WebSocketDisconnect, RuntimeError, OSError):
        pass  # the client is gone, and nobody is left to be told
    finally:
        sessions.detach(session)
        await _drained(link)


async def _ended(session: Session) -> None:
    await session.over.wait()


async def _drained(link: _Link) -> None:
    """Let what is worked on end before the memory that it may write to is given back."""
    waiting: list[Future[Any]] = []
    while not link.answers.empty():
        if isinstance(one := link.answers.get_nowait(), Future):
            waiting.append(one)
    for future in waiting:
        future.cancel()
    for shared in (link.shared, link.offered):
        if shared is None:
            continue
        try:
            link.session.simulator.submit(lambda _, shared=shared: shared.close())
        except ServiceError:
            shared.close()


async def _read(websocket: WebSocket, sessions: Sessions, link: _Link) -> None:
    session, limits = link.session, sessions.limits
    while True:
        message = await websocket.receive()
        if message["type"] == "websocket.disconnect":
            return
        data = message.get("bytes")
        session.counts["operations"] += 1
        if data is None:
            answer: Future[Any] | Frame = _error(0, MalformedFrame("messages are binary frames; text is not read"))
        else:
            session.counts["bytes_in"] += len(data)
            try:
                if link.ahead >= limits.waiting:
                    raise ServiceBusy(f"{limits.waiting} messages wait already; read their answers first")
                answer = sessions.submit(session, lambda env, data=data: _answer(env, data, link, sessions))
                link.ahead += 1
            except AnysimError as error:
                answer = _error(0, error)
        if isinstance(answer, list):
            session.counts["errors"] += 1
        await link.answers.put(answer)


async def _write(websocket: WebSocket, sessions: Sessions, link: _Link) -> None:
    session = link.session
    while (answer := await link.answers.get()) is not None:
        if isinstance(answer, Future):
            try:
                answer = await sessions.result(session, answer)
            except AnysimError as error:
                answer = _error(0, error)
            link.ahead -= 1
        session.counts["bytes_out"] += sum(len(part) for part in answer)
        try:
            for message in wire.messages(answer):
                async with asyncio.timeout(SEND_S):
                    await websocket.send({"type": "websocket.send", "bytes": message})
        except TimeoutError:
            _log.warning("session %s: its client does not read", session.id)
            return


def _answer(env: TaskEnv, data: bytes, link: _Link, sessions: Sessions) -> Frame:
    """The frame that answers one; on the thread of the simulator. Nothing is raised but what ends the thread."""
    number, session = 0, link.session
    try:
        message = wire.unpack(data)
        number = _number(message, session)
        if message.get("op") == "share":
            return wire.parts({"seq": number, "ok": _share(env, message, link)})
        answer = perform(env, message, sessions.limits)
        if message["op"] in ("step", "step_chunk"):
            session.counts["steps"] += int(answer["steps"].sum()) if "steps" in answer else _stepped(env, message)
        if link.shared is not None and "obs" in answer and message.get("slot") is not None:
            answer["obs"] = link.shared.put(answer["obs"], message["slot"])
        return wire.parts({"seq": number, "ok": answer})
    except Exception as error:  # noqa: BLE001 - it is the answer
        if status_of(error) >= 500:
            _log.exception("session %s: an operation failed", session.id)
        session.counts["errors"] += 1
        return _error(number, error)


def _number(message: Mapping[str, Any], session: Session) -> int:
    number = message.get("seq")
    if type(number) is not int or not 0 < number < 1 << 63:
        raise MalformedFrame("each message has a number `seq` of 1 or more")
    if number <= session.last:
        raise MalformedFrame(f"message {number} comes after {session.last}: it was sent before, or out of order")
    session.last = number
    return number


def _stepped(env: TaskEnv, message: Mapping[str, Any]) -> int:
    mask = message.get("mask")
    return env.num_envs if mask is None else int(mask.sum())


def _share(env: TaskEnv, message: Mapping[str, Any], link: _Link) -> dict[str, Any]:
    """Two steps: memory is offered under a name, and the client says what it found there."""
    if (proof := message.get("proof")) is None:
        for old in (link.shared, link.offered):
            if old is not None:
                old.close()
        link.shared = None
        offered = Offer.of(env)
        link.session.counts["shares"] += offered is not None
        link.offered = offered
        return {} if offered is None else offered.terms()
    offered, link.offered = link.offered, None
    if offered is not None and offered.confirmed(proof):
        link.shared = offered
        return {"shared": True}
    if offered is not None:
        offered.close()
    return {"shared": False}


def _error(number: int, error: BaseException) -> Frame:
    return wire.parts({"seq": number, "error": to_data(error)})
