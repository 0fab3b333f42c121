"""WebSocket of a client: binary messages of bounded size, read into memory of their own.

A step waits for its answer, so the socket is read on the thread that asks: no other thread has to be woken, and a
message of many megabytes is received where its arrays will be.
"""

import base64
import hashlib
import os
import select
import socket
import ssl
from collections.abc import Mapping
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim_client.errors import ConnectionLost, LimitExceeded, MalformedFrame

_GUID = b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11"
_CONTINUED, _TEXT, _BINARY, _CLOSE, _PING, _PONG = 0, 1, 2, 8, 9, 10
_BUFFER = 1 << 16
_HEAD_BYTES = 65536


class HandshakeRefusal(Exception):
    """The server answered the handshake as HTTP: `status` and `body`."""

    def __init__(self, status: int, body: bytes) -> None:
        super().__init__(f"{status}")
        self.status, self.body = status, body


class WebSocket:
    """One connection. What is raised for a lost one is ConnectionLost; it is of no use afterwards."""

    def __init__(self, stream: socket.socket, largest: int) -> None:
        """`largest` [bytes] is the most that one message may have."""
        self._stream, self._largest = stream, largest
        self._buffer = bytearray(_BUFFER)
        self._view = memoryview(self._buffer)
        self._start = self._stop = 0

    @classmethod
    def open(
        cls,
        host: str,
        port: int,
        path: str,
        headers: Mapping[str, str],
        *,
        context: ssl.SSLContext | None,
        timeout: float,
        largest: int,
    ) -> "WebSocket":
        """Connect and shake hands.

        Raises:
            ConnectionLost: nobody answers.
            HandshakeRefusal: the server answers otherwise.
        """
        try:
            stream = socket.create_connection((host, port), timeout)
            try:
                stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                if context is not None:
                    stream = context.wrap_socket(stream, server_hostname=host)
                link = cls(stream, largest)
                link._shake_hands(f"[{host}]:{port}" if ":" in host else f"{host}:{port}", path, headers)
            except BaseException:
                stream.close()
                raise
        except OSError as error:
            raise ConnectionLost(f"{host}:{port} cannot be reached: {error}") from None
        return link

    def _shake_hands(self, host: str, path: str, headers: Mapping[str, str]) -> None:
        key = base64.b64encode(os.urandom(16))
        lines = {
            "Host": host,
            "Upgrade": "websocket",
            "Connection": "Upgrade",
            "Sec-WebSocket-Key": key.decode(),
            "Sec-WebSocket-Version": "13",
            **headers,
        }
        head = f"GET {path} HTTP/1.1\r\n" + "".join(f"{name}: {value}\r\n" for name, value in lines.items()) + "\r\n"
        self._stream.sendall(head.encode("latin-1"))
        answer = bytearray()
        while b"\r\n\r\n" not in answer:
            if len(answer) > _HEAD_BYTES:
                raise MalformedFrame("what answers there is no anysim service: its HTTP head does not end")
            answer += self._read(1)
            ready = self._stop - self._start
            answer += self._read(min(ready, _HEAD_BYTES)) if ready else b""
        first, _, rest = bytes(answer).partition(b"\r\n\r\n")
        words = first.split(b"\r\n")
        status = words[0].split(b" ")
        given = {name.strip().lower(): value.strip() for name, _, value in (w.partition(b":") for w in words[1:])}
        if len(status) < 2 or not status[1].isdigit():
            raise MalformedFrame("what answers there does not speak HTTP")
        if int(status[1]) != 101:
            length = int(given.get(b"content-length", b"0") or 0)
            body = rest + (self._read(min(length, _HEAD_BYTES) - len(rest)) if length > len(rest) else b"")
            raise HandshakeRefusal(int(status[1]), body)
        accept = base64.b64encode(hashlib.sha1(key + _GUID, usedforsecurity=False).digest())
        if given.get(b"sec-websocket-accept") != accept or b"sec-websocket-extensions" in given:
            raise MalformedFrame("what answers there does not speak the WebSocket that was asked for")
        self._view[: len(rest)] = rest
        self._start, self._stop = 0, len(rest)

    # ------------------------------------------------------------------ sending

    def send(self, data: bytes) -> None:
        """Send a binary message."""
        self._send(_BINARY, data)

    def _send(self, kind: int, data: bytes) -> None:
        length = len(data)
        if length < 126:
            head = bytes((0x80 | kind, 0x80 | length))
        elif length < 1 << 16:
            head = bytes((0x80 | kind, 0xFE)) + length.to_bytes(2, "big")
        else:
            head = bytes((0x80 | kind, 0xFF)) + length.to_bytes(8, "big")
        mask = os.urandom(4)
        try:
            self._stream.sendall(b"".join((head, mask, _masked(data, mask))))
        except OSError as error:
            raise self._lost(error) from None

    # ------------------------------------------------------------------ receiving

    def receive(self, into: Array | None = None) -> Array:
        """The next binary message as bytes (n,) uint8, in memory of its own or at the beginning of `into`.

        Raises:
            ConnectionLost: the other side has closed, or nothing came in time.
            LimitExceeded: it is larger than was agreed.
        """
        try:
            return self._receive(into)
        except OSError as error:
            raise self._lost(error) from None

    def _receive(self, into: Array | None) -> Array:
        parts: list[Array] = []
        total = 0
        while True:
            first, second = self._read(2)
            kind, length = first & 0x0F, second & 0x7F
            if length >= 126:
                length = int.from_bytes(self._read(2 if length == 126 else 8), "big")
            if first & 0x70 or second & 0x80 or (kind >= _CLOSE and length > 125):
                raise MalformedFrame("the service broke the rules of WebSocket")
            total += length if kind < _CLOSE else 0
            if total > self._largest:
                raise LimitExceeded(f"a message of the service has {total} bytes, more than {self._largest}")
            if into is not None and kind < _CLOSE:
                if length > len(into):
                    raise MalformedFrame("the service sent more than it had said")
                content, into = into[:length], into[length:]
            else:
                content = np.empty(length, np.uint8)
            self._fill(content.data)
            if kind == _PING:
                self._send(_PONG, content.tobytes())
            elif kind == _CLOSE:
                why = content[2:].tobytes().decode("utf-8", "replace") or "no reason given"
                raise ConnectionLost(f"the service closed the connection: {why}")
            elif kind in (_BINARY, _CONTINUED):
                parts.append(content)
                if first & 0x80:
                    return parts[0] if len(parts) == 1 else np.concatenate(parts)
            elif kind != _PONG:
                raise MalformedFrame("the service sent text where frames are binary")

    def _read(self, count: int) -> bytes:
        content = bytearray(count)
        self._fill(memoryview(content))
        return bytes(content)

    def _fill(self, into: memoryview) -> None:
        """Fill memory from the buffer and the socket; what is large is not buffered."""
        while len(into):
            ready = self._stop - self._start
            if ready:
                count = min(ready, len(into))
                into[:count] = self._view[self._start : self._start + count]
                self._start += count
                into = into[count:]
            elif len(into) >= _BUFFER:
                into = into[self._some(into) :]
            else:
                self._start, self._stop = 0, self._some(self._view)

    def _some(self, into: memoryview) -> int:
        count = self._stream.recv_into(into)
        if not count:
            raise ConnectionLost("the service is gone")
        return count

    def waiting(self) -> bool:
        """Whether something can be read now."""
        return self._stop > self._start or bool(select.select([self._stream], [], [], 0)[0])

    def _lost(self, error: OSError) -> ConnectionLost:
        return ConnectionLost("the service did not answer in time" if isinstance(error, TimeoutError) else str(error))

    def fileno(self) -> int:
        """Of the socket, for `select`."""
        return self._stream.fileno()

    def close(self) -> None:
        """Say so, and close."""
        try:
            self._send(_CLOSE, (1000).to_bytes(2, "big"))
        except (OSError, ConnectionLost):
            pass
        finally:
            self._stream.close()


def _masked(data: bytes, mask: bytes) -> Any:
    """The bytes that a client sends: masked, as the rules want it."""
    words = -(-len(data) // 4)
    padded = np.zeros(words, np.uint32)
    padded.view(np.uint8)[: len(data)] = np.frombuffer(data, np.uint8)
    padded ^= np.frombuffer(mask, np.uint32)
    return padded.view(np.uint8).data[: len(data)]
