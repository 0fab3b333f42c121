"""A client of the page without a browser, for measurements and tests: it is told what a browser is told.

python -m anysim_viewer.client URL SECONDS     be a client, and print how much came
"""

import json
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np

PROTOCOL = "viser-v"


class Client:
    """One that has come, and looks from a fixed place."""

    def __init__(self, socket: Any) -> None:
        self._socket = socket
        self.messages = self.windows = self.bytes = 0
        self.send(
            "ViewerCameraMessage",
            wxyz=(1.0, 0.0, 0.0, 0.0),
            position=(1.0, 1.0, 1.0),
            fov=1.0,
            near=0.1,
            far=100.0,
            image_height=480,
            image_width=640,
            look_at=(0.0, 0.0, 0.0),
            up_direction=(0.0, 0.0, 1.0),
        )

    def send(self, kind: str, **fields: object) -> None:
        """Send a message of viser's protocol."""
        import msgspec

        self._socket.send(msgspec.msgpack.encode({"type": kind, **fields}))

    def receive(self, seconds: float) -> list[Mapping[str, Any]]:
        """The messages of the next window, none where none comes in time; arrays are as they were sent."""
        try:
            raw = self._socket.recv(timeout=seconds)
        except TimeoutError:
            return []
        found = decoded(raw)
        self.windows, self.messages, self.bytes = (self.windows + 1, self.messages + len(found), self.bytes + len(raw))
        return found


def decoded(raw: bytes) -> list[Mapping[str, Any]]:
    """The messages of a window."""
    import msgspec
    import zstandard

    size, packed = (int.from_bytes(raw[at : at + 8], "little") for at in (0, 8))
    whole = msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(raw[16 : 16 + packed], size))
    buffers, at = [], 16 + packed
    for length in whole["binaryBufferLengths"]:
        at += -at % 8
        buffers.append(raw[at : at + length])
        at += length

    def filled(value: Any) -> Any:
        if isinstance(value, dict):
            if "__binary_index" in value and "dtype" in value:
                return np.frombuffer(buffers[value["__binary_index"]], dtype=value["dtype"])
            return {key: filled(one) for key, one in value.items()}
        return [filled(one) for one in value] if isinstance(value, list) else value

    return [filled(message) for message in whole["messages"]]


@contextmanager
def connected(url: str) -> Iterator[Client]:
    """A client of the page at a printed address."""
    import viser
    from websockets.sync.client import connect
    from websockets.typing import Subprotocol

    parts = urlsplit(url)
    token = parse_qs(parts.query).get("token", [""])[0]
    with connect(
        f"ws://{parts.netloc}/",
        subprotocols=[Subprotocol(f"{PROTOCOL}{viser.__version__}")],
        additional_headers={"Cookie": f"anysim_view_{parts.port}={token}"},
        compression=None,
        max_size=1 << 30,
    ) as socket:
        yield Client(socket)


def main(url: str, seconds: float) -> None:
    """Be a client for a while, and print what came as JSON."""
    from websockets.exceptions import ConnectionClosed

    with connected(url) as client:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            try:
                client.receive(left)
            except ConnectionClosed:
                break
        told = {"windows": client.windows, "messages": client.messages, "bytes": client.bytes}
    print(json.dumps(told))  # noqa: T201 - it is what the program is for


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
