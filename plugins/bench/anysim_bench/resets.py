"""Growth over thousands of partial resets that change the entities present, with the process looked at."""

import gc
import os
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.capability import Capability
from anysim.errors import EngineError
from anysim.model.world import Slot, World

SLOTS = 10
SAMPLES = 10
SLOWER = 1.3
"""By how much the last resets may be slower than the first before that counts as growth."""

MEMORY_MIB = 24.0
"""Growth that counts [MiB]: allocators keep some pages, caches of bounded size fill up."""

_PROC = Path("/proc/self")


class Sample(NamedTuple):
    """What the process held after some resets.

    Attributes:
        resets: how many.
        memory_mib: resident memory [MiB]; 0 where the system does not say.
        descriptors: open files and sockets; 0 where the system does not say.
        threads: Python's.
        handles: what the engine holds of its library, `SimEngine.handles`.
    """

    resets: int
    memory_mib: float
    descriptors: int
    threads: int
    handles: Mapping[str, int]


class ResetCost(NamedTuple):
    """Partial resets of one engine.

    Attributes:
        engine: its name.
        lifecycle: how its entities come and go.
        num_envs: envs, of which each reset changes one.
        resets: how many.
        first_ms, last_ms: processor time of a reset and the first look at the state after it, mean of the first and of
            the last tenth [ms].
        same_ms: that of a reset that keeps which objects are present, measured afterwards [ms].
        samples: of the process on the way.
        grown: what grew between a fifth of the way and the end, in words; empty where nothing did.
    """

    engine: str
    lifecycle: str
    num_envs: int
    resets: int
    first_ms: float
    last_ms: float
    same_ms: float
    samples: tuple[Sample, ...]
    grown: tuple[str, ...]


def changing_world() -> World:
    """A Panda and a table, and ten slots that can each be a box, a ball or a can, or nothing."""
    from anysim.compile.world import compile_world
    from anysim_schemas.run import WorldSpec

    sources = {"box": {"box": [0.04, 0.04, 0.04]}, "ball": {"sphere": 0.02}, "can": {"cylinder": [0.02, 0.05]}}
    objects: dict[str, object] = {"table": {"source": {"box": [0.8, 1.2, 0.04]}, "fixed": True}}
    places = {"table": (0.7, 0.0, 0.1)}
    for i in range(SLOTS):
        for kind, source in sources.items():
            objects[f"thing{i}_{kind}"] = {"source": source, "mass": 0.1}
            places[f"thing{i}_{kind}"] = (0.5 + 0.08 * (i % 5), 0.1 if i < 5 else -0.1, 0.15)
    spec = {"robots": {"panda": {"robot": "franka_panda"}}, "objects": objects}
    world = compile_world(WorldSpec.model_validate(spec))
    number = {entity.name: i for i, entity in enumerate(world.entities)}
    slots = [Slot(f"thing_{i}", "thing", i, tuple(number[f"thing{i}_{k}"] for k in sources)) for i in range(SLOTS)]
    bodies = tuple(replace(b, position=places.get(b.name, b.position)) for b in world.bodies)
    return replace(world, bodies=bodies, slots=tuple(slots))


def reset_cost(
    engine_name: str, resets: int = 10_000, num_envs: int = 4, tell: Callable[[Sample], None] | None = None
) -> ResetCost:
    """Reset one random env after the other to random entities, step all, and see what grows.

    Raises:
        EngineError: an engine whose entities cannot vary, or fewer than 20 resets.
    """
    from anysim.engine.factory import create_simulation

    if resets < 2 * SAMPLES:
        raise EngineError(f"growth shows in many resets: at least {2 * SAMPLES}, got {resets}")
    rng = np.random.default_rng(0)
    with create_simulation(engine_name) as engine:
        if Capability.VARYING_ENTITIES not in engine.capabilities:
            raise EngineError(f"{engine_name} does not have '{Capability.VARYING_ENTITIES}': nothing to measure")
        world = changing_world()
        engine.create_world(world, num_envs)
        spent, samples = np.zeros(resets), [_sample(0, engine)]
        for number in range(resets):
            ids, rows = rng.integers(num_envs, size=1), _draw(world, rng)
            begin = time.process_time()
            engine.reset(ids, present=rows)
            _ = engine.get_state().body_pose  # what an engine puts off until it is asked counts, too
            spent[number] = time.process_time() - begin
            engine.step(2)
            if (number + 1) * SAMPLES // resets > number * SAMPLES // resets:
                samples.append(_sample(number + 1, engine))
                if tell is not None:
                    tell(samples[-1])
        begin = time.process_time()
        for _ in range(SAMPLES):
            engine.reset([0])
            _ = engine.get_state().body_pose
        same = (time.process_time() - begin) / SAMPLES
        tenth = resets // 10
        # the first resets compile kernels and fill caches
        first, last = 1e3 * float(np.mean(spent[2 : tenth + 2])), 1e3 * float(np.mean(spent[-tenth:]))
        grown = growth(samples, first, last, world, num_envs)
        return ResetCost(
            engine_name, engine.lifecycle.words, num_envs, resets, first, last, 1e3 * same, tuple(samples), grown
        )


def _draw(world: World, rng: np.random.Generator) -> Array:
    """(1, entities) bool: of each slot one of what it can be, or nothing."""
    row = np.ones((1, len(world.entities)), dtype=bool)
    for slot in world.slots:
        row[0, slot.entities] = False
        choice = int(rng.integers(-1, len(slot.entities)))
        if choice >= 0:
            row[0, slot.entities[choice]] = True
    return row


def growth(samples: list[Sample], first_ms: float, last_ms: float, world: World, num_envs: int) -> tuple[str, ...]:
    """What grew, in words. Bodies and the like vary with presence: they may not exceed what all envs can hold."""
    early, late = samples[len(samples) // 5], samples[-1]
    most = num_envs * (len(world.bodies) + len(world.geoms) + 1)
    words = []
    if late.memory_mib - early.memory_mib > MEMORY_MIB:
        words.append(f"memory by {late.memory_mib - early.memory_mib:.0f} MiB")
    for what, before, after in (
        ("descriptors", early.descriptors, late.descriptors),
        ("threads", early.threads, late.threads),
    ):
        if after > before:
            words.append(f"{what} from {before} to {after}")
    for name, count in late.handles.items():
        varies = name in ("bodies", "entities")
        if count > (most if varies else early.handles[name]):
            words.append(f"{name} from {early.handles[name]} to {count}")
    if last_ms > SLOWER * first_ms:
        words.append(f"time per reset from {first_ms:.2f} to {last_ms:.2f} ms")
    return tuple(words)


def resident_mib() -> float:
    """Memory of this process [MiB]; 0 where the system does not say."""
    if not (_PROC / "statm").exists():
        return 0.0
    return int((_PROC / "statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def _sample(resets: int, engine: SimEngine) -> Sample:
    gc.collect()
    descriptors = len(list((_PROC / "fd").iterdir())) if _PROC.exists() else 0
    return Sample(resets, resident_mib(), descriptors, threading.active_count(), dict(engine.handles()))
