"""The page: viser's server behind the gate, with what people ask handed to the thread that may do it."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from io import StringIO
from queue import Empty, SimpleQueue
from types import SimpleNamespace
from typing import Any

import viser
import websockets.asyncio.server
from viser.infra import _infra
from websockets.http11 import Request, Response

from anysim.errors import AnysimError, PluginError
from anysim_viewer.gate import Access, Gate

_making = threading.Lock()


class _Server(viser.ViserServer):
    """viser's server without its tunnel, through which a page could be shown to the whole internet."""

    def request_share_url(self, verbose: bool = True) -> str | None:
        return None


@contextmanager
def _behind(gate: Gate) -> Iterator[None]:
    """Servers that viser makes within listen on the gate's socket, and ask it first."""

    def serve(handler: Any, host: object, port: object, *, process_request: Any, **options: Any) -> Any:
        def checked(connection: Any, request: Request) -> Response | None:
            refused = gate.check(request)
            if refused is not None:
                return refused
            answer = process_request(connection, request)
            return None if answer is None else gate.protected(request, answer)

        gate.used = True
        more: dict[str, Any] = {} if gate.tls is None else {"ssl": gate.tls}
        return websockets.asyncio.server.serve(handler, sock=gate.socket, process_request=checked, **options, **more)

    inside: Any = _infra
    real = inside.websockets
    inside.websockets = SimpleNamespace(
        asyncio=SimpleNamespace(server=SimpleNamespace(serve=serve)),
        datastructures=real.datastructures,
        exceptions=real.exceptions,
    )
    try:
        yield
    finally:
        inside.websockets = real


class Page:
    """A page on a port of its own, until it is closed.

    What people do in it runs on threads of the server; envs are touched by one thread alone. So handlers `ask`, and
    that thread calls `answer`.

    Attributes:
        server: viser's.
        url: of the page, with the token.
    """

    def __init__(self, access: Access, title: str) -> None:
        """Serve the page.

        Raises:
            TaskError: the port cannot be had.
            PluginError: the installed viser does not let itself be guarded.
        """
        self._gate = Gate(access)
        self.address, self.url = self._gate.address, self._gate.url
        self._asked: SimpleQueue[Callable[[], object]] = SimpleQueue()
        with _making, _behind(self._gate), redirect_stdout(StringIO()):  # it prints where it listens
            self.server = _Server(host=access.host, port=self._gate.port, label=title, verbose=False)
        if not self._gate.used:
            self.close()
            raise PluginError(
                f"viser {viser.__version__} makes its server in a way that cannot be guarded, so nothing is served; "
                "install viser 1.1.1"
            )
        self.server.gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        self.server.gui.main_panel.dock_right()

    @property
    def watched(self) -> bool:
        """Whether somebody looks."""
        return bool(self.server.get_clients())

    def ask(self, wish: Callable[[], object]) -> None:
        """Have the thread that owns the envs do something, soon."""
        self._asked.put(wish)

    def answer(self, seconds: float = 0.0) -> bool:
        """Do all that was asked, waiting up to `seconds` for the first of it; returns whether there was something.

        What cannot be done is told in the page.
        """
        done = False
        while True:
            try:
                wish = self._asked.get_nowait() if done or seconds <= 0.0 else self._asked.get(timeout=seconds)
            except Empty:
                return done
            done = True
            try:
                wish()
            except AnysimError as error:
                self.tell(str(error), fault=True)

    def tell(self, words: str, fault: bool = False) -> None:
        """Show a sentence to everyone who looks."""
        for client in self.server.get_clients().values():
            client.add_notification(
                "This cannot be done" if fault else "Done",
                words,
                color="red" if fault else "teal",
                auto_close_seconds=12.0,
            )

    def close(self) -> None:
        """Stop serving and free the port. Further calls do nothing."""
        server = getattr(self, "server", None)
        if server is not None:
            with _making, redirect_stdout(StringIO()):
                server.stop()
        self._gate.close()
