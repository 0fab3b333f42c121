"""Running a service: on this thread until it is told to stop, or on one of its own beside other work."""

import asyncio
import secrets
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from anysim.errors import TaskError
from anysim_client.errors import ServiceError
from anysim_serving.access import Gate
from anysim_serving.catalogue import Catalogue
from anysim_serving.settings import Settings

GRACE_S = 5
"""How long connections may end their requests when the service stops [s]."""


class Service:
    """A service on a port that is taken at once.

    Attributes:
        settings: with the port that it got.
        address: for clients.
        app: the application; `app.state.sessions` are its sessions.
    """

    def __init__(
        self,
        catalogue: Catalogue,
        settings: Settings,
        make: Callable[[Catalogue, Settings], Any] | None = None,
        door: Callable[[Any, Settings], Any] | None = None,
    ) -> None:
        """Take the port; nothing is answered yet.

        `make` makes an application in place of that of `anysim serve`, and `door` what stands before its gate.

        Raises:
            TaskError: the address or the port cannot be had.
        """
        from uvicorn import Config, Server

        from anysim_serving.app import application

        self._socket = _listening(settings)
        self.settings = replace(settings, port=self._socket.getsockname()[1])
        shown = f"[{settings.host}]" if ":" in settings.host else settings.host
        self.address = f"{settings.scheme}://{shown}:{self.settings.port}"
        self.app = (make or application)(replace(catalogue, limits=settings.limits), self.settings)

        class Unsignalled(Server):
            @contextmanager
            def capture_signals(self) -> Iterator[None]:
                yield  # `run` has them, and a thread cannot have any

        gate = Gate(self.app, self.settings)
        config = Config(
            gate if door is None else door(gate, self.settings),
            ws="websockets-sansio",
            ws_max_size=settings.limits.message_bytes,
            ws_per_message_deflate=False,
            ws_ping_interval=20.0,
            ws_ping_timeout=120.0,
            timeout_keep_alive=30,
            timeout_graceful_shutdown=GRACE_S,
            limit_concurrency=1024,
            ssl_certfile=None if settings.certificate is None else str(settings.certificate),
            ssl_keyfile=None if settings.key is None else str(settings.key),
            lifespan="on",
            log_config=None,
            access_log=False,
            server_header=False,
            date_header=False,
            proxy_headers=False,
        )
        try:
            config.load()
        except OSError as error:
            self._socket.close()
            raise TaskError(f"the TLS certificate or key cannot be used: {error}") from None
        self._server = Unsignalled(config)

    @property
    def answering(self) -> bool:
        """Whether it has begun."""
        return self._server.started

    def run(self, told: Callable[[], object]) -> None:
        """Serve until SIGINT or SIGTERM; a second one ends connections that are still open.

        `told` is called once it answers.
        """

        async def serve() -> None:
            loop = asyncio.get_running_loop()

            def stop() -> None:
                self._server.force_exit = self._server.should_exit
                self._server.should_exit = True

            for number in (signal.SIGINT, signal.SIGTERM):
                loop.add_signal_handler(number, stop)
            task = asyncio.create_task(self._server.serve(sockets=[self._socket]))
            while not self._server.started and not task.done():
                await asyncio.sleep(0.01)
            if self._server.started:
                told()
            await task

        try:
            asyncio.run(serve())
        finally:
            self._socket.close()

    def start(self) -> None:
        """Serve on a thread of its own until `stop`."""
        self._thread = threading.Thread(
            target=lambda: asyncio.run(self._server.serve(sockets=[self._socket])), name="anysim service", daemon=True
        )
        self._thread.start()
        while not self._server.started:
            self._thread.join(0.005)
            if not self._thread.is_alive():
                raise ServiceError("the service ended before it answered; its log says why")

    def stop(self) -> None:
        """End what `start` began: connections, sessions, envs, and the port."""
        self._server.should_exit = True
        self._thread.join()
        self._socket.close()


@contextmanager
def serving(*sources: Any, settings: Settings | None = None, **options: Any) -> Iterator[Service]:
    """A service of tasks and worlds on a thread, for notebooks and tests.

    Args:
        sources: installed tasks by name, files, or mappings.
        settings: how it is run; by default on any port of loopback with a fresh token.
        options: of `Catalogue`.
    """
    chosen = Settings(token=fresh_token()) if settings is None else settings
    service = Service(Catalogue.of(sources, limits=chosen.limits, **options), chosen)
    service.start()
    try:
        yield service
    finally:
        service.stop()


def fresh_token() -> str:
    """A token of 256 bits."""
    return secrets.token_urlsafe(32)


def _listening(settings: Settings) -> socket.socket:
    try:
        family, kind, _, _, address = socket.getaddrinfo(
            settings.host, settings.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listening = socket.socket(family, kind)
        try:
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listening.bind(address)
            listening.listen(128)
        except BaseException:
            listening.close()
            raise
    except OSError as error:
        raise TaskError(
            f"the service cannot listen on {settings.host}:{settings.port}: {error.strerror or error}; choose another "
            f"--host or --port, 0 for any port"
        ) from None
    return listening
