"""Gain of worker processes: the same world with several numbers of shards, in one run, in interleaved rounds."""

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import NamedTuple

from anysim.engine.base import SimEngine
from anysim.errors import EngineError
from anysim_bench.step import control_loop, panda_and_boxes

CHUNK_STEPS = 4000
"""Physics steps of one timed chunk over all envs together, at least ten control steps."""


class ShardGain(NamedTuple):
    """What a number of shards gains.

    Attributes:
        shards: worker processes; 1 is the engine without any.
        num_envs: envs.
        rate: physics steps per second of all envs together, best round [steps/s, wall].
        ratio: that over the rate of the first number of shards; it says something where as many cores are idle.
        cpu_ratio: the same by the processor time of the longest path, which is that of the parent and of its slowest
            worker: what idle cores would gain, and other load on the machine disturbs less.
    """

    shards: int
    num_envs: int
    rate: float
    ratio: float
    cpu_ratio: float


def shard_gains(engine_name: str, num_envs: int, shards: Sequence[int], rounds: int = 7) -> list[ShardGain]:
    """Step a Panda and five boxes, writing commands and reading the state every control step.

    Raises:
        EngineError: a number of shards is below 1 or above `num_envs`.
    """
    from anysim.api import compile_world
    from anysim.engine.factory import create_simulation

    for count in shards:
        if not 1 <= count <= num_envs:
            raise EngineError(f"{count} shards cannot hold {num_envs} envs; 1 to {num_envs} expected")
    world = compile_world(panda_and_boxes())
    substeps = world.physics.substeps
    calls = max(10, CHUNK_STEPS // (num_envs * substeps))
    best: dict[int, tuple[float, float]] = {}
    with ExitStack() as stack:
        engines: dict[int, SimEngine] = {}
        for count in dict.fromkeys(shards):
            engine = stack.enter_context(create_simulation(engine_name, shards=count)).create_world(world, num_envs)
            engine.step(100)  # the boxes come to rest, kernels are compiled
            engines[count] = engine
        loops = {count: control_loop(engine, substeps) for count, engine in engines.items()}
        for loop in loops.values():
            for _ in range(3):
                loop()
        for _ in range(rounds):
            for count, loop in loops.items():
                spent = _timed(engines[count], loop, calls)
                best[count] = min(spent[0], best.get(count, spent)[0]), min(spent[1], best.get(count, spent)[1])
    steps = calls * substeps * num_envs
    wall, cpu = best[shards[0]]
    return [ShardGain(count, num_envs, steps / w, wall / w, cpu / c) for count, (w, c) in best.items()]


def _timed(engine: SimEngine, loop: Callable[[], None], calls: int) -> tuple[float, float]:
    """Wall time, and processor time of the parent and the slowest worker one after the other [s]."""
    workers = engine.processor_times()
    wall, cpu = time.perf_counter(), time.process_time()
    for _ in range(calls):
        loop()
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    spent = [after - before for after, before in zip(engine.processor_times(), workers, strict=True)]
    return wall, cpu + max(spent, default=0.0)
