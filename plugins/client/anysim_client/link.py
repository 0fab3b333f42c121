"""Link of a client to its session: the control plane over HTTP, and one socket for what is asked of the env."""

import contextlib
import http.client
import json
import os
import ssl
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math.arrays import shown
from anysim_client import wire
from anysim_client.errors import ConnectionLost, LimitExceeded, ServiceError, from_data
from anysim_client.messages import PROTOCOL
from anysim_client.token import TOKEN_ENV, kept_token
from anysim_client.websocket import HandshakeRefusal, WebSocket

LARGEST = 1 << 30
"""Bytes of one answer."""
KEY = "Anysim-Session-Key"


class Address:
    """Where a service is, and the token that it is asked with.

    That is the one that was given, that of the environment, or what a service of this user keeps on this machine.
    """

    def __init__(
        self, address: str, token: str | None = None, ca: str | Path | None = None, timeout: float = 660.0
    ) -> None:
        """`ca` is a PEM file of who signs the service's certificate; default: those that the system trusts."""
        parts = urlsplit(address)
        if parts.scheme not in ("http", "https") or not parts.hostname or parts.path not in ("", "/") or parts.username:
            raise TaskError(f"a service has an address such as http://127.0.0.1:8470, got {shown(address)}")
        self.address = address.rstrip("/")
        self.host, self.port = parts.hostname, parts.port or (443 if parts.scheme == "https" else 80)
        try:
            self.context = ssl.create_default_context(cafile=ca) if parts.scheme == "https" else None
        except OSError as error:
            raise TaskError(f"ca: {ca} is no PEM file of certificates that can be read: {error}") from None
        self.timeout = timeout
        given = token or os.environ.get(TOKEN_ENV) or kept_token(address)
        self._headers = {"Authorization": f"Bearer {given}"} if given else {}

    def ask(self, method: str, path: str, body: Any = None, key: str = "", timeout: float | None = None) -> Any:
        """The JSON that the service answers; None where it has nothing to say.

        Raises:
            AnysimError: what it refuses with.
            ConnectionLost: nobody answers.
        """
        headers = self.headers(key) | ({} if body is None else {"Content-Type": "application/json"})
        limit = self.timeout if timeout is None else timeout
        if self.context is None:
            link = http.client.HTTPConnection(self.host, self.port, timeout=limit)
        else:
            link = http.client.HTTPSConnection(self.host, self.port, timeout=limit, context=self.context)
        with contextlib.closing(link):
            try:
                link.request(method, path, None if body is None else json.dumps(body), headers)
                answer = link.getresponse()
                status, content = answer.status, answer.read(LARGEST)
            except ssl.SSLCertVerificationError as error:
                raise ConnectionLost(
                    f"the certificate of {self.address} is not trusted ({error.verify_message}); if it should be, give "
                    f"`ca`, a PEM file of who signed it"
                ) from None
            except (OSError, http.client.HTTPException) as error:
                raise ConnectionLost(f"no service answers at {self.address}: {error or type(error).__name__}") from None
        if status >= 400:
            raise refusal(status, content)
        return json.loads(content) if content else None

    def headers(self, key: str = "") -> dict[str, str]:
        """Those that a request has."""
        return self._headers | ({KEY: key} if key else {})


def refusal(status: int, body: bytes) -> Exception:
    """The error of an answer that is one."""
    try:
        return from_data(json.loads(body)["error"])
    except (ValueError, KeyError, TypeError):
        return ServiceError(f"what answers there is no anysim service, or refuses: HTTP {status}")


class Link:
    """A session, and the connection to it.

    Attributes:
        spec: what the service said of the env.
    """

    def __init__(self, address: Address, request: dict[str, Any]) -> None:
        """Create a session.

        Raises:
            AnysimError: the service refuses it, or the env cannot be built.
        """
        self.address = address
        made = address.ask("POST", "/v1/sessions", request)
        self.id, self._key, self.spec = str(made["id"]), str(made["key"]), made["spec"]
        self._number, self._socket = 0, None
        try:
            if self.spec["protocol"] != PROTOCOL:
                raise ServiceError(
                    f"the service speaks version {self.spec['protocol']} of the protocol, this client {PROTOCOL}; "
                    f"install the same version of anysim-client on both sides"
                )
            self.attach()
        except BaseException:
            self.close()
            raise

    def attach(self) -> None:
        """Connect to the session; anew where the connection was lost and the session has not ended yet."""
        where = self.address
        try:
            self._socket = WebSocket.open(
                where.host,
                where.port,
                f"/v1/sessions/{self.id}/socket",
                where.headers(self._key),
                context=where.context,
                timeout=where.timeout,
                largest=LARGEST,
            )
        except HandshakeRefusal as refused:
            raise refusal(refused.status, refused.body) from None
        self._number = 0

    def send(self, op: str, **arguments: Any) -> None:
        """Ask for something; `receive` gives the answer. What is None is left out."""
        if self._socket is None:
            raise ConnectionLost("the env is closed, or its service is gone; connect anew")
        self._number += 1
        said = {name: value for name, value in arguments.items() if value is not None}
        try:
            self._socket.send(wire.pack({"op": op, "seq": self._number, **said}))
        except ConnectionLost:
            self.drop()
            raise

    def receive(self) -> dict[str, Any]:
        """The next answer.

        Raises:
            AnysimError: what the service refused with; the link can be used on.
            ConnectionLost: it cannot.
        """
        if self._socket is None:
            raise ConnectionLost("the env is closed, or its service is gone; connect anew")
        try:
            answer = wire.unpack(self._frame(self._socket))
        except ServiceError:
            self.drop()
            raise
        if "error" in answer:
            raise from_data(answer["error"])
        if answer.get("seq") != self._number:
            self.drop()
            raise ConnectionLost(f"the service answered {answer.get('seq')} where {self._number} was asked")
        return answer["ok"]

    def _frame(self, socket: WebSocket) -> Array:
        message = socket.receive()
        total = wire.announced(message)
        if not total:
            return message
        if total > LARGEST:
            raise LimitExceeded(f"an answer of the service has {total} bytes, more than {LARGEST}")
        frame, place = np.empty(total, np.uint8), 0
        while place < total:
            place += len(socket.receive(frame[place:]))
        return frame

    def call(self, op: str, **arguments: Any) -> dict[str, Any]:
        """Ask, and wait for the answer."""
        self.send(op, **arguments)
        return self.receive()

    def drop(self) -> None:
        """Close the connection; the session waits a while for another."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def close(self) -> None:
        """End the session."""
        self.drop()
        with contextlib.suppress(ServiceError):
            self.address.ask("DELETE", f"/v1/sessions/{self.id}", key=self._key, timeout=10.0)
