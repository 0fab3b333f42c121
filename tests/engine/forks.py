"""Program that forks beside a living engine and prints what forks say: `python -m tests.engine.forks ENGINE SHARDS`."""

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable

import anysim
from anysim.engine.factory import create_simulation
from anysim.task.env import TaskEnv
from tests.engine.test_lifetime import ACTION, FALL, fall

USES: dict[str, Callable[[TaskEnv], object]] = {
    "step": lambda env: env.step(ACTION),
    "reset": lambda env: env.reset(seed=1),
    "state": lambda env: env.engine.get_state().body_pose,
    "snapshot": lambda env: env.snapshot(),
    "create_world": lambda env: env.engine.create_world(anysim.compile_world(FALL)),
}


def in_a_fork(work: Callable[[], object]) -> str:
    """What a forked process says; one that hangs is killed, and says nothing."""
    reading, writing = os.pipe()
    pid = os.fork()
    if pid == 0:
        signal.alarm(60)
        try:
            words = str(work())
        except BaseException as error:  # noqa: BLE001 - told to the parent
            words = f"{type(error).__name__}: {error}"
        os.write(writing, words.encode())
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as end:
        words = end.read().decode()
    return words if os.waitpid(pid, 0)[1] == 0 else "it hangs"


def height(env: TaskEnv) -> float:
    """How far the first box has fallen."""
    return float(env.engine.get_state().body_pose[0, 0, 2])


def own_env(copy: TaskEnv, engine: str) -> float:
    """A fork closes its copy and makes an env."""
    copy.close()
    with fall(engine) as env:
        return height(env)


def main(engine: str, shards: int) -> None:
    """Everything with an engine that has a world."""
    with fall(engine, shards) as env:
        before = height(env)
        for use in USES.values():
            print(in_a_fork(lambda use=use: use(env)))
        print(os.getpid())
        child = multiprocessing.get_context("fork").Process(target=sys.exit)  # Python's own end frees what there is
        child.start()
        child.join(60.0)
        print(child.exitcode)
        print(in_a_fork(lambda: own_env(env, engine)))
        print(before)
        env.step(ACTION)  # that of this process goes on
        if env.info["fault"].any():
            raise SystemExit("the parent's env was disturbed")


if __name__ == "__main__":
    if sys.argv[1:]:
        main(sys.argv[1], int(sys.argv[2]))
    else:
        simulation = create_simulation("null")
        print(in_a_fork(lambda: simulation.create_world(anysim.compile_world(FALL)).world.name))
