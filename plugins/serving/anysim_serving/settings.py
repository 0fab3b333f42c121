"""Settings of a service: what it listens on, what it gives at most, and how long it waits."""

from dataclasses import dataclass
from pathlib import Path

from anysim.errors import TaskError
from anysim_client.token import LOOPBACK


@dataclass(frozen=True)
class Limits:
    """What one service gives at most.

    Attributes:
        sessions: at once.
        envs: of one session.
        total_envs: of all sessions together.
        waiting: operations that wait for one simulator; more are refused as busy.
        message_bytes: of one message from a client, and of a snapshot.
        body_bytes: of the JSON of one request.
        chunk: control steps of one `step_chunk`.
        pixels: of all images of one `render`.
        op_s: seconds that one operation may take; beyond them the session is ended.
        idle_s: seconds after which a session that nobody uses is ended.
        linger_s: the same, where its client's connection is gone.
        lifetime_s: seconds after which a session is ended in any case.
    """

    sessions: int = 16
    envs: int = 256
    total_envs: int = 1024
    waiting: int = 8
    message_bytes: int = 64 << 20
    body_bytes: int = 1 << 20
    chunk: int = 1024
    pixels: int = 64 << 20
    op_s: float = 600.0
    idle_s: float = 600.0
    linger_s: float = 30.0
    lifetime_s: float = 7 * 86400.0


@dataclass(frozen=True)
class Settings:
    """How a service is run.

    Attributes:
        host, port: where it listens; port 0 is any that is free.
        token: who sends it may do everything; empty: everyone who reaches the port may, on loopback alone.
        hosts: names under which it may be asked, beside its own address.
        origins: origins of web pages that may ask.
        certificate, key: PEM files of TLS.
        limits: what it gives at most.
    """

    host: str = "127.0.0.1"
    port: int = 0
    token: str = ""
    hosts: tuple[str, ...] = ()
    origins: tuple[str, ...] = ()
    certificate: Path | None = None
    key: Path | None = None
    limits: Limits = Limits()

    def __post_init__(self) -> None:
        if not self.token and not self.on_loopback:
            raise TaskError(
                f"a service on {self.host} needs a token: everyone who reaches that address could use it; leave out "
                f"--no-token, or listen on 127.0.0.1"
            )
        if self.key is not None and self.certificate is None:
            raise TaskError("a TLS key needs its certificate: --tls-certificate FILE")

    @property
    def on_loopback(self) -> bool:
        """Whether this machine alone can reach it."""
        return self.host in LOOPBACK

    @property
    def scheme(self) -> str:
        """`https` with a certificate."""
        return "http" if self.certificate is None else "https"
