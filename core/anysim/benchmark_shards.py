"""What worker processes gain: the same world with several numbers of shards, in one run, in interleaved rounds."""

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from statistics import median
from typing import NamedTuple

from anysim.benchmark import panda_and_boxes
from anysim.engine.base import SimEngine
from anysim.errors import EngineError

CHUNK_STEPS = 4000
"""Physics steps of one timed chunk over all envs together, at least ten control steps."""


class ShardGain(NamedTuple):
    """What a number of shards gains.

    Attributes:
        shards: worker processes; 1 is the engine without any.
        num_envs: envs.
        rate: physics steps per second of all envs together, best round [steps/s, wall].
        ratio: that over the rate of the first number of shards.
        typical: the median over the rounds of the ratio within a round, which a busy machine lowers.
    """

    shards: int
    num_envs: int
    rate: float
    ratio: float
    typical: float


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
    spent: dict[int, list[float]] = {count: [] for count in shards}
    with ExitStack() as stack:
        loops: dict[int, Callable[[], None]] = {}
        for count in spent:
            engine = stack.enter_context(create_simulation(engine_name, shards=count)).create_world(world, num_envs)
            engine.step(100)  # the boxes come to rest, kernels are compiled
            loops[count] = control_loop(engine, substeps)
            loops[count]()
        for _ in range(rounds):
            for count, loop in loops.items():
                start = time.perf_counter()
                for _ in range(calls):
                    loop()
                spent[count].append(time.perf_counter() - start)
    steps = calls * substeps * num_envs
    first = spent[shards[0]]
    return [
        ShardGain(
            count, num_envs, steps / min(times), min(first) / min(times),
            median(one / other for one, other in zip(first, times, strict=True)),
        )
        for count, times in spent.items()
    ]  # fmt: skip


def control_loop(engine: SimEngine, substeps: int) -> Callable[[], None]:
    """One control step: commands in, physics, joints and bodies out."""
    targets = engine.control.position

    def step() -> None:
        engine.set_control(position=targets)
        engine.step(substeps)
        state = engine.get_state()
        _ = state.joint_pos, state.joint_vel, state.body_pose, state.body_twist

    return step
