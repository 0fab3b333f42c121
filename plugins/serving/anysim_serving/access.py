"""Access to a service: the token, the names it answers to, foreign web pages, and the size of what is sent.

All of it is decided before a request reaches the application, for HTTP and WebSocket alike: first the Host, so that a
name which was made to mean this machine leads nowhere; then the Origin, so that no web page can ask; then the token.
"""

import hmac
import ipaddress
import json
import re
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

from anysim_client.errors import ForbiddenSource, LimitExceeded, ServiceError, Unauthorized, to_data
from anysim_client.token import LOOPBACK
from anysim_serving.settings import Settings

SNAPSHOT_TYPE = "application/octet-stream"
Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
SCHEMES = ("bearer", "api-key")
"""Words before the token in the header: that of services, and that of openpi's clients."""
_HOST = re.compile(r"(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+)(:\d{1,5})?")


class Gate:
    """The application behind its checks."""

    def __init__(self, app: Callable[[Scope, Receive, Send], Awaitable[None]], settings: Settings) -> None:
        self._app, self._settings = app, settings
        self._names = {name.lower() for name in settings.hosts}
        self._names |= set(LOOPBACK) if settings.on_loopback else {settings.host.lower()}
        self._any_address = settings.host in ("0.0.0.0", "::")
        self._token = settings.token.encode()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        try:
            headers = _headers(scope)
            self._check(headers)
            if scope["type"] == "http":
                receive = self._bounded(receive, headers)
        except ServiceError as error:
            await refuse(scope, receive, send, error)
            return
        await self._app(scope, receive, send)

    def _check(self, headers: dict[str, str]) -> None:
        host = _HOST.fullmatch(headers.get("host", ""))
        name = host.group(1).strip("[]").lower() if host else ""
        if not (name in self._names or (self._any_address and (name in LOOPBACK or _is_address(name)))):
            raise ForbiddenSource(
                "this service does not answer to that Host; its owner can allow it: --allow-host NAME"
            )
        origin = headers.get("origin")
        if origin is not None and origin not in self._settings.origins:
            raise ForbiddenSource("web pages may not ask this service; its owner can allow one: --allow-origin ORIGIN")
        scheme, _, given = headers.get("authorization", "").partition(" ")
        right = hmac.compare_digest(given.strip().encode(), self._token)
        if self._token and not (right and scheme.lower() in SCHEMES):
            raise Unauthorized("the token is missing or wrong; send `Authorization: Bearer TOKEN`, as was printed")

    def _bounded(self, receive: Receive, headers: dict[str, str]) -> Receive:
        limits = self._settings.limits
        binary = headers.get("content-type", "").partition(";")[0].strip() == SNAPSHOT_TYPE
        most = limits.message_bytes if binary else limits.body_bytes
        said = headers.get("content-length", "0")
        if not said.isdecimal() or int(said) > most:
            raise LimitExceeded(f"at most {most} bytes may be sent at once")
        got = 0

        async def bounded() -> MutableMapping[str, Any]:
            nonlocal got
            message = await receive()
            got += len(message.get("body", b""))
            if got > most:
                raise LimitExceeded(f"at most {most} bytes may be sent at once")
            return message

        return bounded


def _headers(scope: Scope) -> dict[str, str]:
    """The headers by lower name; one that matters here and comes twice is refused."""
    found: dict[str, str] = {}
    for raw, value in scope["headers"]:
        name = raw.decode("latin-1").lower()
        if name in found and name in ("host", "origin", "authorization", "content-length"):
            raise ForbiddenSource(f"the header {name} comes twice")
        found[name] = value.decode("latin-1")
    return found


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


async def refuse(scope: Scope, receive: Receive, send: Send, error: ServiceError) -> None:
    """Answer with an error; a WebSocket is answered before it is one."""
    body = json.dumps({"error": to_data(error)}).encode()
    prefix = "http" if scope["type"] == "http" else "websocket.http"
    if scope["type"] == "websocket":
        await receive()  # the connect message
    more = [(b"www-authenticate", b"Bearer")] if error.status == 401 else []
    head = [(b"content-type", b"application/json"), (b"content-length", str(len(body)).encode()), *more]
    await send({"type": f"{prefix}.response.start", "status": error.status, "headers": head})
    await send({"type": f"{prefix}.response.body", "body": body})
