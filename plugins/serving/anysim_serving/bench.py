"""Costs of a service: round trips and bytes per second against a bare echo server, and many clients for long.

The env that is served stands still: its observations are there already, so what is measured is the service and its
client and nothing else. The echo server is the library `websockets` alone: it sends bytes of the same number.
"""

import asyncio
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from anysim.task.contract import Obs
from anysim_client import wire
from anysim_client.connect import connect
from anysim_client.errors import ServiceError
from anysim_client.websocket import WebSocket

ENVS, NUMBERS, CAMERAS, SIDE = 64, 50, 4, 128
"""Of the observation: 64 envs, 50 numbers each; and images of 4 cameras, 12.6 MB."""
ROUND_TRIP_MS, IMAGES_MB_S, SHARED_MS = 0.6, 750.0, 1.0
"""The least that is good enough."""
WORLD: dict[str, Any] = {
    "engine": "null",
    "world": {
        "name": "still",
        "objects": {"ball": {"source": {"sphere": 0.03}, "mass": 0.2}},
        "layout": {"ball": {"position": [0.0, 0.0, 0.1]}},
    },
    "task": {"horizon": 100, "observations": {"policy": [{"term": "frame_pose", "frame": "ball"}]}},
}


class Exchange(NamedTuple):
    """Milliseconds of one exchange: the median and the fastest, and processor time of both sides together."""

    ms: float
    fastest_ms: float
    processor_ms: float


class Cost(NamedTuple):
    """A row of the table: `megabytes` that an exchange gives, what it costs here, and what beside it an echo costs."""

    what: str
    megabytes: float
    service: Exchange
    echo: Exchange
    budget: str
    missed: bool


def costs(seconds: float) -> Iterator[Cost]:
    """Measure each kind of exchange for about so long."""
    with _server("still") as said:
        options: dict[str, Any] = {"token": said["token"], "num_envs": ENVS}
        with connect(said["address"], images="raw", **options) as plain:
            images = list(plain.image_shapes)
            yield _cost("observation", plain, ["policy"], said, seconds)
            yield _cost("observation and images", plain, ["policy", *images], said, seconds)
        with connect(said["address"], images="shared", **options) as shared:
            yield _cost("the same, shared memory", shared, ["policy", *images], said, seconds)


def _cost(what: str, env: Any, keys: list[str], said: dict[str, Any], seconds: float) -> Cost:
    size = sum(rows.nbytes for rows in env.observe(keys).values())
    frame = len(wire.pack({"bytes": np.zeros(64 if env.shares_memory else size, np.uint8)}))
    with _echo(said["echo"], frame) as echo:
        ours, theirs = _in_turn(lambda: env.observe(keys), echo, said["process"], seconds)
    mb = size / 1e6
    if env.shares_memory:
        budget, missed = f"{SHARED_MS:g} ms", ours.ms > SHARED_MS
    elif mb > 1:
        budget, missed = f"{IMAGES_MB_S:g} MB/s", mb / ours.ms * 1e3 < IMAGES_MB_S
    else:
        budget, missed = f"{ROUND_TRIP_MS:g} ms", ours.ms > ROUND_TRIP_MS
    return Cost(what, mb, ours, theirs, budget, missed)


def _in_turn(
    ours: Callable[[], Any], theirs: Callable[[], Any], process: int, seconds: float
) -> tuple[Exchange, Exchange]:
    """Both in turn, in short blocks, once they are warm: whatever else the machine does meets both."""
    for _ in range(5):
        ours()
        theirs()
    taken: tuple[list[float], list[float]] = ([], [])
    worked = [0.0, 0.0]
    ends = time.perf_counter() + seconds
    while time.perf_counter() < ends or len(taken[0]) < 20:
        for side, one in enumerate((ours, theirs)):
            before = time.process_time() + _worked(process)
            for _ in range(10):
                began = time.perf_counter()
                one()
                taken[side].append((time.perf_counter() - began) * 1e3)
            worked[side] += time.process_time() + _worked(process) - before
    found = [Exchange(float(np.median(ms)), min(ms), s * 1e3 / len(ms)) for ms, s in zip(taken, worked, strict=True)]
    return found[0], found[1]


def _worked(process: int) -> float:
    """Processor time of all threads of a process [s]; not a number where the system does not tell."""
    total = 0.0
    try:
        for task in os.scandir(f"/proc/{process}/task"):
            with open(f"{task.path}/schedstat") as file:  # noqa: PTH123
                total += float(file.read().split()[0]) / 1e9
    except OSError:
        return float("nan")
    return total


@contextmanager
def _echo(port: int, size: int) -> Iterator[Callable[[], Any]]:
    """Ask the echo server for so many bytes."""
    link = WebSocket.open("127.0.0.1", port, "/", {}, context=None, timeout=60, largest=1 << 30)

    def ask() -> Any:
        link.send(size.to_bytes(8, "little"))
        return link.receive()

    try:
        yield ask
    finally:
        link.close()


# ------------------------------------------------------------------------------------------------------- many clients


class Soak(NamedTuple):
    """How many clients fared: control steps of each, errors in words, and what is left of them.

    `fairness` is Jain's index: 1 where all had as many steps, 1/n where one had all. Memory [MB] is the service's, when
    every client had begun, and at the end of the run while all of them were still there.
    """

    clients: int
    seconds: float
    steps: tuple[int, ...]
    errors: tuple[str, ...]
    fairness: float
    memory_mb: float
    memory_end_mb: float
    sessions_left: int
    threads_left: int


def soak(clients: int, seconds: float) -> Soak:
    """Clients, each with a session of its own, that step as fast as they are answered."""
    with _server("blocks", str(clients)) as said:
        _visit(said, clients)  # has the service begin the threads that it keeps for work beside its loop
        threads_before = _status(said["process"], "Threads")
        errors: list[str] = []
        steps = [0] * clients
        begun, ends = threading.Barrier(clients + 1), threading.Event()

        def client(number: int) -> None:
            try:
                with connect(said["address"], token=said["token"]) as env:
                    env.reset(seed=number)
                    begun.wait(600)
                    while not ends.is_set():
                        if not env.running.all():
                            env.reset()
                        env.step(np.zeros((1, 0)))
                        steps[number] += 1
                    begun.wait(600)
            except Exception as error:  # noqa: BLE001 - what the run is to find
                errors.append(f"client {number}: {type(error).__name__}: {error}")
                begun.abort()

        threads = [threading.Thread(target=client, args=(i,), name=f"client {i}") for i in range(clients)]
        for thread in threads:
            thread.start()
        memory = memory_end = 0.0
        began = time.perf_counter()
        try:
            begun.wait(600)
            time.sleep(min(seconds / 10, 10.0))
            memory = _status(said["process"], "VmRSS") / 1e3
            began = time.perf_counter()
            steps[:] = [0] * clients
            ends.wait(seconds)
            memory_end = _status(said["process"], "VmRSS") / 1e3
            counted, took = tuple(steps), time.perf_counter() - began
            ends.set()
            begun.wait(600)
        except threading.BrokenBarrierError:
            counted, took = tuple(steps), time.perf_counter() - began
        finally:
            ends.set()
        for thread in threads:
            thread.join()
        threads_left, left = 0, clients
        for _ in range(100):  # sessions are freed after their clients are told so
            left = _sessions(said)
            threads_left = int(_status(said["process"], "Threads") - threads_before)
            if not left and threads_left <= 0:
                break
            time.sleep(0.1)
        total = float(sum(counted))
        fairness = total**2 / (clients * float(np.sum(np.square(counted)))) if total else 0.0
        return Soak(clients, took, counted, tuple(errors), fairness, memory, memory_end, left, max(threads_left, 0))


def _visit(said: dict[str, Any], clients: int) -> None:
    """Have all clients come at once, and leave again."""

    def client(number: int) -> None:
        with connect(said["address"], token=said["token"]) as env:
            env.reset(seed=number)

    with ThreadPoolExecutor(clients) as pool:
        list(pool.map(client, range(clients)))
    end = time.monotonic() + 10.0
    while _sessions(said) and time.monotonic() < end:
        time.sleep(0.1)


def _sessions(said: dict[str, Any]) -> int:
    from anysim_client.link import Address

    try:
        return int(Address(said["address"], said["token"]).ask("GET", "/v1/health")["sessions"])
    except ServiceError:
        return -1


def _status(process: int, key: str) -> float:
    """A number of /proc/PID/status; not a number where there is none of these."""
    try:
        with open(f"/proc/{process}/status") as file:  # noqa: PTH123
            return next(float(line.split()[1]) for line in file if line.startswith(f"{key}:"))
    except (OSError, StopIteration):
        return float("nan")


# ------------------------------------------------------------------------------------------------- the server's process


@contextmanager
def _server(*what: str) -> Iterator[dict[str, Any]]:
    """A process with a service and an echo server, which ends with its standard input."""
    command = [sys.executable, "-m", __name__, *what]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            if not line:
                raise ServiceError("the process of the service ended before it answered")
            yield json.loads(line)
        finally:
            process.stdin.close()  # type: ignore[union-attr]
            try:
                process.wait(60)
            except subprocess.TimeoutExpired:
                process.kill()


class _Still:
    """An env whose observations are there already."""

    def __init__(self, env: Any) -> None:
        self._env = env
        rng = np.random.default_rng(0)
        self.image_shapes = {f"images/camera_{i}": (SIDE, SIDE, 3) for i in range(CAMERAS)}
        self.observation_sizes = {"policy": NUMBERS}
        self.obs: Obs = {"policy": rng.normal(size=(ENVS, NUMBERS)).astype(np.float32)} | {
            name: rng.integers(0, 256, (ENVS, *shape), dtype=np.uint8) for name, shape in self.image_shapes.items()
        }

    def __getattr__(self, name: str) -> Any:
        return getattr(self._env, name)


def _serve(what: str, clients: int) -> None:
    from anysim_serving.catalogue import Catalogue
    from anysim_serving.server import Service, fresh_token
    from anysim_serving.settings import Limits, Settings

    class Stands(Catalogue):
        def build(self, request: Any) -> Any:
            env = super().build(request)
            return _Still(env) if what == "still" else env

    limits = Limits(sessions=clients + 2, total_envs=1 << 16)
    service = Service(Stands.of([WORLD], limits=limits), Settings(token=fresh_token(), limits=limits))
    service.start()
    loop = asyncio.new_event_loop()
    echo, port = loop.run_until_complete(_echoing())
    thread = threading.Thread(target=loop.run_forever, name="echo", daemon=True)
    thread.start()
    said = {"address": service.address, "token": service.settings.token, "echo": port, "process": os.getpid()}
    sys.stdout.write(json.dumps(said) + "\n")
    sys.stdout.flush()
    sys.stdin.read()
    loop.call_soon_threadsafe(loop.stop)
    thread.join()
    echo.close()
    loop.run_until_complete(echo.wait_closed())
    loop.close()
    service.stop()


async def _echoing() -> tuple[Any, int]:
    from websockets.asyncio.server import serve

    kept: dict[int, bytes] = {}

    async def answer(link: Any) -> None:
        async for message in link:
            size = int.from_bytes(message, "little")
            await link.send(kept.setdefault(size, bytes(size)))

    server = await serve(answer, "127.0.0.1", 0, compression=None, max_size=None)
    return server, next(iter(server.sockets)).getsockname()[1]


if __name__ == "__main__":
    _serve(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 8)
