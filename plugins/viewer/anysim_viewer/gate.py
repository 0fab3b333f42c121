"""The gate before the page: the port, the token, the names it answers to, and no other site.

viser serves everyone who reaches its port, and a web page of any site may open a WebSocket to this machine. So every
request passes here first: its Host, so that a name which was made to mean this machine leads nowhere; its Origin, so
that no other page can look or drive; then the token, which the printed address carries once and a cookie from then on.
"""

import hmac
import ipaddress
import re
import secrets
import socket
import ssl
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

from websockets import Headers
from websockets.http11 import Request, Response

from anysim.errors import TaskError

LOOPBACK = ("127.0.0.1", "localhost", "::1")
_HOST = re.compile(r"(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+)(:\d{1,5})?")
_POLICY = (
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'; "
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:"
)
PROTECTION = {"Cache-Control": "no-store", "Referrer-Policy": "no-referrer", "X-Content-Type-Options": "nosniff"}
"""What every answer says, beside the page's policy."""


@dataclass(frozen=True)
class Access:
    """Where the page is served, and who may see it.

    Attributes:
        host, port: where it listens; port 0 is any that is free.
        token: who has it may see and do everything; empty: everyone who reaches the port may, on loopback alone.
        hosts: names under which it may be asked, beside its own address.
        certificate, key: PEM files of TLS.
    """

    host: str = "127.0.0.1"
    port: int = 0
    token: str = ""
    hosts: tuple[str, ...] = ()
    certificate: Path | None = None
    key: Path | None = None

    def __post_init__(self) -> None:
        if not self.token and not self.on_loopback:
            raise TaskError(
                f"a view on {self.host} needs a token: everyone who reaches that address could use it; leave out "
                "--no-token, or listen on 127.0.0.1 and come by ssh -L"
            )
        if self.key is not None and self.certificate is None:
            raise TaskError("a TLS key needs its certificate: --tls-certificate FILE")

    @property
    def on_loopback(self) -> bool:
        """Whether this machine alone can reach it."""
        return self.host in LOOPBACK


def fresh_token() -> str:
    """A token of 192 bits."""
    return secrets.token_urlsafe(24)


class Gate:
    """Lets through who may see the page, and answers everyone else.

    Attributes:
        socket: that listens.
        port: of it.
        used: whether the server inside has taken it.
    """

    def __init__(self, access: Access) -> None:
        """Take the port.

        Raises:
            TaskError: the address or the port cannot be had, or the certificate cannot be used.
        """
        self.access, self.used = access, False
        self.tls = _tls(access)
        self.socket = _listening(access)
        self.port = int(self.socket.getsockname()[1])
        self._cookie = f"anysim_view_{self.port}"
        self._names = {name.lower() for name in access.hosts} | {access.host.lower()}
        self._names |= set(LOOPBACK) if access.on_loopback else set()
        self._any_address = access.host in ("0.0.0.0", "::")

    @property
    def scheme(self) -> str:
        """`https` with a certificate."""
        return "http" if self.tls is None else "https"

    @property
    def address(self) -> str:
        """Of the page, without the token."""
        shown = f"[{self.access.host}]" if ":" in self.access.host else self.access.host
        return f"{self.scheme}://{shown}:{self.port}/"

    @property
    def url(self) -> str:
        """Of the page, for who may see it."""
        return self.address + (f"?token={self.access.token}" if self.access.token else "")

    def check(self, request: Request) -> Response | None:
        """The answer to a request that goes no further, or None for one that may pass."""
        headers = request.headers
        if any(len(headers.get_all(name)) > 1 for name in ("Host", "Origin")):
            return refusal(HTTPStatus.BAD_REQUEST, "a header comes twice")
        host = headers.get("Host", "")
        found = _HOST.fullmatch(host)
        name = found.group(1).strip("[]").lower() if found else ""
        if not (name in self._names or (self._any_address and (name in LOOPBACK or _is_address(name)))):
            words = "this view does not answer to that Host; its owner can allow it: --allow-host NAME"
            return refusal(HTTPStatus.MISDIRECTED_REQUEST, words)
        origin = headers.get("Origin")
        if origin is not None and origin.lower() != f"{self.scheme}://{host}".lower():
            return refusal(HTTPStatus.FORBIDDEN, "another site must not look into this view, nor drive it")
        if not self.access.token:
            return None
        upgrade = headers.get("Upgrade", "").lower() == "websocket"
        given = parse_qs(urlsplit(request.path).query).get("token", [""])[0]
        if not upgrade and self._right(given):
            return self._welcome()
        if not self._right(self._kept(headers)):
            words = "the token is missing or wrong; open the address that was printed, whole"
            return refusal(HTTPStatus.UNAUTHORIZED, words)
        return None

    def protected(self, request: Request, response: Response) -> Response:
        """An answer of the server inside: its page loads nothing from elsewhere, and stands in no other page.

        It talks to where it came from, whose name a worker that is made of a blob has to be told.
        """
        host = request.headers.get("Host", "")
        own = f"connect-src 'self' {self.scheme}://{host} {self.scheme.replace('http', 'ws')}://{host} data: blob:"
        for name, value in {**PROTECTION, "Content-Security-Policy": f"{_POLICY}; {own}"}.items():
            if name in response.headers:
                del response.headers[name]
            response.headers[name] = value
        return response

    def close(self) -> None:
        """Free the port."""
        self.socket.close()

    def _right(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(), self.access.token.encode())

    def _kept(self, headers: Headers) -> str:
        pairs = (pair.strip().partition("=") for line in headers.get_all("Cookie") for pair in line.split(";"))
        return next((value for name, _, value in pairs if name == self._cookie), "")

    def _welcome(self) -> Response:
        """Have the browser keep the token, and drop it from the address."""
        secure = "; Secure" if self.tls is not None else ""
        cookie = f"{self._cookie}={self.access.token}; Path=/; HttpOnly; SameSite=Strict{secure}"
        more = {"Location": "/", "Set-Cookie": cookie, "Content-Length": "0"}
        more |= {"Content-Security-Policy": _POLICY}
        return Response(HTTPStatus.SEE_OTHER, "See Other", Headers({**PROTECTION, **more}), b"")


def refusal(status: HTTPStatus, words: str) -> Response:
    """An answer that is a sentence."""
    body = f"{words}\n".encode()
    more = {"Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(body)), "Connection": "close"}
    more |= {"Content-Security-Policy": _POLICY}
    return Response(status, status.phrase, Headers({**PROTECTION, **more}), body)


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _tls(access: Access) -> ssl.SSLContext | None:
    if access.certificate is None:
        return None
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    try:
        context.load_cert_chain(access.certificate, access.key)
    except OSError as error:
        raise TaskError(f"the TLS certificate or key cannot be used: {error}") from None
    return context


def _listening(access: Access) -> socket.socket:
    try:
        family, kind, _, _, address = socket.getaddrinfo(
            access.host, access.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listening = socket.socket(family, kind)
        try:
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listening.bind(address)
            listening.listen(32)
        except BaseException:
            listening.close()
            raise
    except OSError as error:
        raise TaskError(
            f"the view cannot listen on {access.host}:{access.port}: {error.strerror or error}; choose another --host "
            "or --port, 0 for any port"
        ) from None
    return listening
