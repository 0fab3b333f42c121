"""The server of the browser's page: on loopback alone, for those who have the token, and for no other site.

The page itself holds no secret. Its address carries the token behind `#`, which browsers do not send; what the page
then asks for needs it in a header. A foreign site that is open in the same browser is refused by its Origin, and one
whose name was made to mean this machine by its Host.
"""

import hmac
import json
import secrets
import threading
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from typing import Annotated, Any, cast

from pydantic import Field, ValidationError

from anysim.errors import TaskError
from anysim_schemas.base import Spec

LARGEST = 4096
"""[bytes] of what the page may send at once."""
_STATIC = {"/": ("page.html", "text/html; charset=utf-8"), "/page.js": ("page.js", "text/javascript; charset=utf-8")}
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'unsafe-inline'; connect-src 'self'; img-src blob:; "
    "frame-ancestors 'none'"
)
Stick = Annotated[float, Field(ge=-1, le=1)]
Key = Annotated[str, Field(max_length=16)]


class PageInput(Spec):
    """What the page sends: keys that are down, keys that went down, and the sticks of a gamepad as a twist."""

    held: Annotated[tuple[Key, ...], Field(max_length=32)] = ()
    pressed: Annotated[tuple[Key, ...], Field(max_length=32)] = ()
    sticks: tuple[Stick, Stick, Stick, Stick, Stick, Stick] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class PageLink:
    """What the page and the session tell each other; each method may be called by any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._latest: PageInput | None = None
        self._pressed: list[str] = []
        self._shown: dict[str, Any] = {"line": "", "told": [], "picture": 0}
        self._picture = b""

    def sent(self, message: PageInput) -> dict[str, Any]:
        """The page has sent something; returns what it is to show."""
        with self._lock:
            self._latest = message
            self._pressed = [*self._pressed, *message.pressed][-64:]
            return dict(self._shown)

    def take(self) -> tuple[PageInput | None, list[str]]:
        """What came last, None if nothing since it was last asked, and all keys that went down meanwhile."""
        with self._lock:
            latest, self._latest = self._latest, None
            pressed, self._pressed = self._pressed, []
            return latest, pressed

    def show(self, line: str, picture: bytes | None = None) -> None:
        """The status, and a new picture (JPEG) if there is one."""
        with self._lock:
            self._shown["line"] = line
            if picture is not None:
                self._picture = picture
                self._shown["picture"] += 1

    def tell(self, line: str) -> None:
        """A line that stays."""
        with self._lock:
            self._shown["told"] = [*self._shown["told"], line][-8:]

    @property
    def picture(self) -> bytes:
        """The latest picture, JPEG."""
        with self._lock:
            return self._picture


class PageServer(ThreadingHTTPServer):
    """Serves the page on a port of loopback until it is stopped.

    Attributes:
        link: what the page and the session tell each other.
        url: of the page, with the token.
    """

    daemon_threads = True
    block_on_close = False
    allow_reuse_address = True

    def __init__(self, port: int) -> None:
        """Take the port, 0 for any.

        Raises:
            TaskError: it is taken.
        """
        try:
            super().__init__(("127.0.0.1", port), _Handler)
        except OSError as error:
            raise TaskError(
                f"the page cannot be served on port {port} of 127.0.0.1: {error.strerror or error}; choose another "
                "one with -D port=N, or leave it out for any"
            ) from None
        self.link = PageLink()
        self.token = secrets.token_urlsafe(24)
        self.url = f"http://127.0.0.1:{self.server_port}/#{self.token}"
        self.hosts = {f"127.0.0.1:{self.server_port}", f"localhost:{self.server_port}"}
        self._thread = threading.Thread(target=self.serve_forever, args=(0.05,), name="teleop page", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Free the port."""
        self.shutdown()
        self._thread.join()
        self.server_close()


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    timeout = 10.0

    @property
    def _page(self) -> PageServer:
        return cast("PageServer", self.server)

    def do_GET(self) -> None:
        if self._refused(needs_token=self.path not in _STATIC):
            return
        if self.path in _STATIC:
            name, kind = _STATIC[self.path]
            self._answer(HTTPStatus.OK, kind, files(__package__ or "anysim_teleop").joinpath(name).read_bytes())
        elif self.path.partition("?")[0] == "/picture":
            self._answer(HTTPStatus.OK, "image/jpeg", self._page.link.picture)
        else:
            self._refuse(HTTPStatus.NOT_FOUND, "there is no such page")

    def do_POST(self) -> None:
        if self._refused(needs_token=True):
            return
        size = self.headers.get("Content-Length", "")
        if self.path != "/input" or not (size.isdecimal() and int(size) <= LARGEST):
            self._refuse(HTTPStatus.BAD_REQUEST, f"POST /input with at most {LARGEST} bytes is expected")
            return
        try:
            message = PageInput.model_validate_json(self.rfile.read(int(size)))
        except ValidationError:
            self._refuse(HTTPStatus.BAD_REQUEST, "keys and sticks as JSON are expected")
            return
        self._answer(HTTPStatus.OK, "application/json", json.dumps(self._page.link.sent(message)).encode())

    def _refused(self, needs_token: bool) -> bool:
        """Answer what must not be answered, and say that it was."""
        host, origin = self.headers.get("Host", ""), self.headers.get("Origin")
        given = self.headers.get("Authorization", "").removeprefix("Bearer ")
        if host not in self._page.hosts:
            self._refuse(HTTPStatus.MISDIRECTED_REQUEST, "this server answers to 127.0.0.1 and localhost alone")
        elif origin is not None and origin != f"http://{host}":
            self._refuse(HTTPStatus.FORBIDDEN, "another site must not drive the robot")
        elif needs_token and not hmac.compare_digest(given.encode(), self._page.token.encode()):
            self._refuse(HTTPStatus.UNAUTHORIZED, "the token is missing or wrong; open the address that was printed")
        else:
            return False
        return True

    def _refuse(self, status: HTTPStatus, words: str) -> None:
        self.close_connection = True  # its body has not been read
        self._answer(status, "text/plain; charset=utf-8", words.encode())

    def _answer(self, status: HTTPStatus, kind: str, body: bytes) -> None:
        self.send_response(status)
        headers = {
            "Content-Type": kind,
            "Content-Length": str(len(body)),
            "Cache-Control": "no-store",
            "Content-Security-Policy": _POLICY,
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
        }
        if self.close_connection:
            headers["Connection"] = "close"
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing: the terminal belongs to the session."""
