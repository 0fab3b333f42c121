"""Views of worker processes from outside, for tests: processes, descriptors, and a program to compare runs."""

import os
import time
from pathlib import Path

import numpy as np

from anysim.testing import worlds
from anysim.testing.compare import play, read, spread, tape

PROC = Path("/proc")


def alive(pid: int) -> bool:
    """Whether a process runs: a zombie does not."""
    try:
        return (PROC / str(pid) / "stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def gone(pids, within_s: float = 20.0) -> bool:
    """Wait until none of the processes runs."""
    end = time.perf_counter() + within_s
    while time.perf_counter() < end:
        if not any(map(alive, pids)):
            return True
        time.sleep(0.02)
    return False


def children() -> set[int]:
    """The processes that this one started and that are there, dead ones too."""
    found = set()
    for stat in PROC.glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except (FileNotFoundError, ProcessLookupError):
            continue
        if int(fields[1]) == os.getpid():
            found.add(int(stat.parent.name))
    return found


def descriptors() -> int:
    return len(list((PROC / "self" / "fd").iterdir()))


def segments() -> set[str]:
    """Names in the shared memory but for semaphores: shards have none, and process pools beside us do."""
    folder = Path("/dev/shm")
    return {path.name for path in folder.iterdir() if not path.name.startswith("sem.")} if folder.exists() else set()


def program(engine, seed: int = 0, envs: int = 5, level: str = "trajectory"):
    """A run in which everything happens that an engine offers to all of them; returns what was read on the way."""
    rng = np.random.default_rng(seed)
    engine.create_world(worlds.scene(), envs)
    pages = []
    spread(engine, seed)
    play(engine, tape(engine.world, range(envs), 6, seed))
    pages.append(read(engine))
    kept = engine.snapshot([4, 1, 0], level)
    for name in sorted(engine.parameters & {"body.mass", "actuator.kp", "geom.friction", "joint.damping"}):
        chosen = np.sort(rng.permutation(envs)[:2])
        engine.set_parameters(name, engine.get_parameters(name, chosen) * 1.25, chosen)
        pages.append({name: engine.get_parameters(name)})
    engine.reset([3, 0])
    for _ in range(4):
        chosen = rng.permutation(envs)[: int(rng.integers(1, envs + 1))]
        engine.set_control(position=0.1 * rng.standard_normal((len(chosen), 2)), env_ids=chosen)
        engine.step(int(rng.integers(1, 4)), chosen)
    pages.append(read(engine))
    engine.restore(kept, [2, 4, 3])
    engine.step(3)
    pages.append(read(engine))
    engine.set_joint_state(0.1 * rng.standard_normal((2, 2)), env_ids=[4, 1])
    pages.append(read(engine))
    engine.add_object("crate", {"box": [0.2, 0.2, 0.2]}, mass=1.5, position=(3.0, 3.0, 0.5))
    pages.append(read(engine))
    engine.step(4)
    engine.remove_object("crate")
    engine.step(2)
    pages.append(read(engine))
    return pages
