"""Access to a service: the token, the names it answers to, foreign web pages, and the size of what is sent.

All of it is decided before a request reaches the application, for HTTP and WebSocket alike: first the Host, so that a
name which was made to mean this machine leads nowhere; then the Origin, so that no web page can ask; then the token.
"""

import hmac
import ipaddress
import json
import os
import re
import stat
from collections.abc import Awaitable, Callable, MutableMapping
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from anysim_serving.errors import ForbiddenSource, LimitExceeded, ServiceError, Unauthorized, to_data
from anysim_serving.settings import LOOPBACK, Settings

TOKEN_ENV = "ANYSIM_SERVE_TOKEN"
SNAPSHOT_TYPE = "application/octet-stream"
Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
_HOST = re.compile(r"(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+)(:\d{1,5})?")


class Gate:
    """The application behind its checks."""

    def __init__(self, app: Callable[[Scope, Receive, Send], Awaitable[None]], settings: Settings) -> None:
        self._app, self._settings = app, settings
        self._names = {name.lower() for name in settings.hosts}
        self._names |= set(LOOPBACK) if settings.on_loopback else {settings.host.lower()}
        self._any_address = settings.host in ("0.0.0.0", "::")  # noqa: S104 - compared, not listened on
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
            raise ForbiddenSource("this service does not answer to that Host; its owner can allow it: --allow-host NAME")
        origin = headers.get("origin")
        if origin is not None and origin not in self._settings.origins:
            raise ForbiddenSource("web pages may not ask this service; its owner can allow one: --allow-origin ORIGIN")
        scheme, _, given = headers.get("authorization", "").partition(" ")
        right = hmac.compare_digest(given.strip().encode(), self._token)
        if self._token and not (right and scheme.lower() == "bearer"):
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


# -------------------------------------------------------------------------------------- the token of the user's own clients


def token_file(address: str) -> Path:
    """Where the token of a service on this machine is kept, by its port."""
    from platformdirs import user_state_dir

    folder = os.environ.get("ANYSIM_STATE_DIR") or user_state_dir("anysim", appauthor=False)
    return Path(folder) / "services" / f"{urlsplit(address).port}.json"


def keep_token(address: str, token: str) -> Path:
    """Write the token for clients of the same user: a file that nobody else can read, whole or not there."""
    path = token_file(address)
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    path.parent.chmod(0o700)
    aside = path.with_name(f".{path.name}.{os.getpid()}")
    aside.unlink(missing_ok=True)
    descriptor = os.open(aside, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0), 0o600)
    with os.fdopen(descriptor, "w") as file:
        json.dump({"address": address, "token": token, "process": os.getpid()}, file)
    aside.replace(path)
    return path


def forget_token(path: Path, token: str) -> None:
    """Remove the file, unless a later service has written its own."""
    if (kept := _read(path)) is not None and hmac.compare_digest(str(kept.get("token")), token):
        path.unlink(missing_ok=True)


def kept_token(address: str) -> str:
    """The token that a service of this user on this machine keeps for its clients; empty if there is none.

    It is read from a file that is this user's and nobody else's, and for loopback alone: no other machine is sent it.
    """
    parts = urlsplit(address)
    if parts.hostname not in LOOPBACK:
        return ""
    kept = _read(token_file(address))
    if kept is None or urlsplit(str(kept.get("address"))).port != parts.port:
        return ""
    return str(kept.get("token", ""))


def _read(path: Path) -> dict[str, Any] | None:
    try:
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0))
    except OSError:
        return None
    with os.fdopen(descriptor) as file:
        about = os.fstat(descriptor)
        private = stat.S_ISREG(about.st_mode) and about.st_uid == os.getuid() and not about.st_mode & 0o077
        try:
            found = json.loads(file.read(65536)) if private else None
        except ValueError:
            return None
    return found if isinstance(found, dict) else None
