"""Cost model of `--executor ray`: figures that are measured here, and what 10 to 10,000 workers would make of them.

    .venv-ray/bin/python benchmarks/cluster.py                  measure, and simulate
    .venv-ray/bin/python benchmarks/cluster.py --cameras        the same with the cameras of the task recorded
    .venv-ray/bin/python benchmarks/cluster.py --figures a.json simulate with figures that an earlier run wrote

Measured, in processor seconds, which other programs on the machine change little: an episode and the bytes of its
trajectory, the start of a worker, what the process that asks spends on a result and on each of its bytes, and Ray's
`wait` by the number of workers. Simulated, event by event: workers that take a round each when they are free, and the
one process that hands rounds out and commits what comes back, which does one thing at a time. Nothing is simulated of
the network but its rate, and nothing of the scheduler of Ray but the time it takes until a lost node is missed.
"""

import argparse
import heapq
import json
import pickle  # noqa: TID251  as Ray carries results
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

TASK, ENVS, ROUNDS = "pick_cube", 4, 4
"""What is measured: rounds of so many episodes."""
WORKERS = (10, 100, 1_000, 10_000)
ROUNDS_OF_A_WORKER = 30
BATCH = 256
"""Results that are fetched at one look: `anysim_ray.crew.BATCH`."""
PAYLOAD = 4 << 20
"""Bytes of the larger of two results with which Ray is measured."""


class Figures(NamedTuple):
    """What was measured.

    Attributes:
        rounds_s: processor seconds [s] of rounds of `envs` episodes.
        envs: episodes of a round.
        round_bytes: of the trajectories of a round.
        start_s: processor seconds [s] until a worker begins its first round: imports, and its env.
        keep_s, keep_byte_s: of the process that asks, to commit a round, and for each of its bytes.
        ray_s, ray_byte_s: the same, to hand a round out and fetch it, without `wait`.
        wait_s: `ray.wait`, for each worker that is asked.
    """

    rounds_s: list[float]
    envs: int
    round_bytes: float
    start_s: float
    keep_s: float
    keep_byte_s: float
    ray_s: float
    ray_byte_s: float
    wait_s: float


class Cluster(NamedTuple):
    """What is assumed: rates and failures.

    Attributes:
        bytes_per_s: that the machine of the process that asks can take in; 1.25e9 is 10 Gb/s.
        node_lives_s: mean seconds [s] until a node is lost.
        missed_s: seconds [s] until a lost node is missed.
        again_s: until a worker has begun in the place of a lost one, without `start_s`.
    """

    bytes_per_s: float = 1.25e9
    node_lives_s: float = 86_400.0
    missed_s: float = 20.0
    again_s: float = 5.0


class Load(NamedTuple):
    """What a simulation gives: rounds and bytes a second, how busy the one that asks and the workers are, losses."""

    workers: int
    rounds_per_s: float
    bytes_per_s: float
    driver: float
    efficiency: float
    lost: int


def simulate(figures: Figures, cluster: Cluster, workers: int, rng: np.random.Generator) -> Load:
    """Workers take rounds one after the other; the process that asks serves one of them at a time."""
    fetch = figures.ray_s + figures.round_bytes * figures.ray_byte_s
    keep = figures.keep_s + figures.round_bytes * figures.keep_byte_s
    look = 2 * figures.wait_s * workers
    transfer = figures.round_bytes / cluster.bytes_per_s
    busy = network = worked = driven = end = 0.0  # the first two until when, the others for how long
    done = lost = batch = 0
    looked = -1.0
    wanted = ROUNDS_OF_A_WORKER * workers
    draws = iter(rng.choice(figures.rounds_s, 2 * wanted).tolist())
    lives = iter(rng.exponential(cluster.node_lives_s, 2 * wanted).tolist())
    events = [(figures.start_s, worker, 0.0) for worker in range(workers)]  # free at, worker, seconds of its last round
    heapq.heapify(events)
    given = workers
    while events:
        now, worker, took = heapq.heappop(events)
        if took > 0.0:
            network = max(network, now) + transfer
            if network > looked or batch == BATCH:  # all that is there is fetched, before the next look
                busy = looked = max(busy, network) + look
                driven, batch = driven + look, 0
            batch += 1
            now = busy + fetch
            busy = now + keep
            driven, done, worked, end = driven + fetch + keep, done + 1, worked + took, busy
            if given >= wanted:
                continue
            given += 1
        length = next(draws)
        if next(lives) < length:
            lost += 1
            length += cluster.missed_s + cluster.again_s + figures.start_s + next(draws)
        heapq.heappush(events, (now + length, worker, length))
    end_bytes = done * figures.round_bytes
    useful = done * float(np.mean(figures.rounds_s))
    return Load(workers, done / end, end_bytes / end, driven / end, useful / (workers * end), lost)


# ---------------------------------------------------------------------- what is measured


def slope(small: tuple[float, float], large: tuple[float, float]) -> tuple[float, float]:
    """Seconds at no bytes, and for each byte, from two measurements (bytes, seconds); neither is below 0."""
    each = max(0.0, (large[1] - small[1]) / (large[0] - small[0]))
    return max(0.0, small[1] - each * small[0]), each


def measure_rounds(cameras: bool) -> tuple[list[float], list[bytes], float]:
    """Processor seconds of rounds, what they gave as a worker sends it, and the start of a worker."""
    from anysim_collect.rounds import running_rounds
    from anysim_collect.sharing import shared_job

    job, _ = shared_job(TASK, None, ENVS, 0, [] if cameras else ["record.cameras=[]"])
    job = job._replace(episodes=ENVS * (ROUNDS + 1))
    seconds: list[float] = []
    sent: list[bytes] = []
    with running_rounds() as run:
        for number in range(ROUNDS + 1):
            began = time.process_time()
            made = run(job, number, frozenset())
            seconds.append(time.process_time() - began)
            sent.append(pickle.dumps(made, protocol=5))
    return seconds[1:], sent[1:], max(0.0, seconds[0] - float(np.median(seconds[1:])))


def measure_keeping(sent: Sequence[bytes]) -> tuple[float, float]:
    """Processor seconds to read and commit a round, and for each of its bytes."""
    from anysim_collect.sharing import Keeper

    points: list[tuple[float, float]] = []
    with tempfile.TemporaryDirectory() as folder:
        for number, whole in enumerate((False, True)):
            keeper = Keeper(Path(folder) / str(number))
            began = time.process_time()
            size = 0
            for data in sent:
                made = pickle.loads(data)
                episodes = made.episodes if whole else [one._replace(files={"a": b"a"}) for one in made.episodes]
                size += sum(len(content) for one in episodes for content in one.files.values())
                keeper.keep(made.run, episodes)
            points.append((size / len(sent), (time.process_time() - began) / len(sent)))
            keeper.close()
    return slope(*points)


def measure_ray() -> tuple[float, float, float]:
    """Processor seconds of the one that asks: for an item, for a byte of its result, and of `wait` for a worker."""
    from anysim_ray.cluster import connected

    with connected("local") as ray:

        @ray.remote(num_cpus=1)
        class Giver:
            def give(self, item: bytes, size: int) -> bytes:
                return bytes(size)

        giver = Giver.remote()
        item = bytes(1000)
        ray.get(giver.give.remote(item, 0))
        points: list[tuple[float, float]] = []
        for size, times in ((0, 200), (PAYLOAD, 30)):
            began = time.process_time()
            for _ in range(times):
                [ref], _ = ray.wait([giver.give.remote(item, size)], num_returns=1)
                len(ray.get(ref))
            points.append((size, (time.process_time() - began) / times))

        @ray.remote(resources={"not_there": 1})
        def never() -> None: ...

        pending = [never.remote() for _ in range(1000)]
        waits: list[tuple[float, float]] = []
        for count in (10, 1000):
            began = time.process_time()
            for _ in range(50):
                ray.wait(pending[:count], num_returns=1, timeout=0)
            waits.append((count, (time.process_time() - began) / 50))
        for ref in pending:
            ray.cancel(ref)
    return *slope(*points), slope(*waits)[1]


def start_of_worker() -> float:
    """Processor seconds of the imports of a worker."""
    import os
    import subprocess
    import sys

    before = os.times()
    subprocess.run([sys.executable, "-c", "import anysim_collect.rounds, anysim_mujoco.engine"], check=True)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def measured(cameras: bool) -> Figures:
    """All figures of this machine."""
    rounds, sent, build = measure_rounds(cameras)
    return Figures(
        rounds,
        ENVS,
        float(np.mean([len(data) for data in sent])),
        build + start_of_worker(),
        *measure_keeping(sent),
        *measure_ray(),
    )


def main() -> None:
    """Measure, simulate, and print both."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--cameras", action="store_true", help="record the cameras of the task")
    parser.add_argument("--figures", type=Path, help="a file of figures, in place of measuring")
    parser.add_argument("--out", type=Path, help="write the figures there")
    given = parser.parse_args()
    if given.figures is not None:
        figures = Figures(**json.loads(given.figures.read_text()))
    else:
        try:
            import ray  # noqa: F401  # pyright: ignore[reportMissingImports, reportUnusedImport]
        except ImportError:
            print("Ray is not installed here: `make test-ray` makes an environment with it, .venv-ray")
            return
        figures = measured(given.cameras)
        if given.out is not None:
            given.out.write_text(json.dumps(figures._asdict(), indent=1) + "\n")
    told: dict[str, Any] = figures._asdict() | {"rounds_s": f"{np.mean(figures.rounds_s):.3f} (mean)"}
    for name, value in told.items():
        print(f"{name:14} {value if isinstance(value, str | int) else f'{value:.3g}'}")
    print("\n| workers | rounds/s | episodes/s | MB/s | busy: the one that asks | busy: workers | lost |")
    print("|---|---|---|---|---|---|---|")
    for workers in WORKERS:
        load = simulate(figures, Cluster(), workers, np.random.default_rng(0))
        print(
            f"| {workers:,} | {load.rounds_per_s:,.1f} | {load.rounds_per_s * figures.envs:,.0f} | "
            f"{load.bytes_per_s / 1e6:,.1f} | {load.driver:.0%} | {load.efficiency:.0%} | {load.lost} |"
        )


if __name__ == "__main__":
    main()
