"""The door before the page: a browser has no token to send, so it gets a cookie for the one in the address.

What then reaches the gate of services (`anysim_serving.access`) is a request with that token. A page of any other
origin is still refused there: of this one alone the Origin is taken away, which is told by the Host, and that the gate
looks at.
"""

import hmac
from typing import Any
from urllib.parse import parse_qs

from anysim_serving.access import Receive, Scope, Send
from anysim_serving.settings import Settings

PROTECTION = (
    (b"cache-control", b"no-store"),
    (b"referrer-policy", b"same-origin"),
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"content-security-policy", b"default-src 'self' 'unsafe-inline' data:; frame-ancestors 'none'; base-uri 'none'"),
)
"""What every answer says: a page loads nothing from elsewhere, and stands in no other page."""


class Door:
    """An application in a browser."""

    def __init__(self, app: Any, settings: Settings) -> None:
        self._app, self._token, self._scheme = app, settings.token, settings.scheme
        self._cookie = f"anysim_app_{settings.port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        given = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [""])[0]
        if scope["method"] == "GET" and self._right(given):
            await self._welcome(send)
            return
        headers = [(name, value) for name, value in scope["headers"] if name != b"authorization"]
        if not self._right(kept := self._kept(headers)):
            words = b"The token is missing or wrong: open the address that was printed, whole.\n"
            await self._answer(send, 401, [(b"content-type", b"text/plain; charset=utf-8")], words)
            return
        host = next((value for name, value in headers if name == b"host"), b"")
        own = f"{self._scheme}://".encode() + host
        headers = [(name, value) for name, value in headers if not (name == b"origin" and value == own)]
        headers.append((b"authorization", b"Bearer " + kept.encode("latin-1")))
        await self._app({**scope, "headers": headers}, receive, _protected(send))

    def _right(self, given: str) -> bool:
        return bool(given) and hmac.compare_digest(given.encode(), self._token.encode())

    def _kept(self, headers: list[tuple[bytes, bytes]]) -> str:
        lines = (value.decode("latin-1") for name, value in headers if name == b"cookie")
        pairs = (pair.strip().partition("=") for line in lines for pair in line.split(";"))
        return next((value for name, _, value in pairs if name == self._cookie), "")

    async def _welcome(self, send: Send) -> None:
        """Have the browser keep the token, and drop it from the address."""
        cookie = f"{self._cookie}={self._token}; Path=/; HttpOnly; SameSite=Strict"
        await self._answer(send, 303, [(b"location", b"/"), (b"set-cookie", cookie.encode())])

    async def _answer(self, send: Send, status: int, more: list[tuple[bytes, bytes]], body: bytes = b"") -> None:
        headers = [*PROTECTION, (b"content-length", str(len(body)).encode()), *more]
        await send({"type": "http.response.start", "status": status, "headers": headers})
        await send({"type": "http.response.body", "body": body})


def _protected(send: Send) -> Send:
    async def sent(message: Any) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message.get("headers", []), *PROTECTION]}
        await send(message)

    return sent
