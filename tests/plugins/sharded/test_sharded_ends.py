"""Ends of programs: their workers end with them, and no shared memory stays. Programs are plain scripts."""

import os
import signal
import subprocess
import sys
import textwrap
import time
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import pytest

from anysim.testing import worlds
from anysim.testing.compare import assert_same, read
from anysim.testing.kinematic import NullEngine
from anysim_sharded.engine import sharded
from anysim_sharded.pool import keeping_workers
from tests.plugins.sharded.shards_help import PROC, alive, children, gone, segments

pytestmark = pytest.mark.skipif(not PROC.exists(), reason="no /proc here: processes cannot be seen from outside")

# no `if __name__ == "__main__"`, and what a second run of the script would do shows
SCRIPT = """
    import sys
    from pathlib import Path
    Path(sys.argv[1]).open("a").write("run\\n")
    import anysim
    env = anysim.make("pick_cube", engine="null", num_envs=4, overrides=[
        "engine.shards=2", "record.cameras=[]", "world.cameras.front.channels=[]", "world.cameras.wrist.channels=[]",
    ])
    env.reset(seed=1)
    print(*env.engine.workers, flush=True)
"""
STEP_FOR_EVER = """
    import numpy as np
    action = np.zeros((4, env.action_dim))
    while True:
        env.reset()
        env.step(action)
"""
WAIT = """
    sys.stdin.read()
"""
WAYS = [pytest.param(STEP_FOR_EVER, id="stepping"), pytest.param(WAIT, id="waiting", marks=pytest.mark.slow)]


def _start(tmp_path, more, **options):
    script = tmp_path / "script.py"
    script.write_text(textwrap.dedent(SCRIPT) + textwrap.dedent(more))
    environment = {**os.environ, "TMPDIR": str(tmp_path / "tmp")}
    (tmp_path / "tmp").mkdir()
    return subprocess.Popen(
        [sys.executable, str(script), str(tmp_path / "runs")],
        cwd=tmp_path,
        env=environment,
        text=True,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        **options,
    )


def _workers(process):
    line = process.stdout.readline()
    if not line:
        raise AssertionError(process.communicate()[1])
    return [int(pid) for pid in line.split()]


def _finish(process):
    """What it printed; it is ended if it does not end by itself."""
    try:
        return process.communicate(timeout=60)
    finally:
        process.kill()
        process.wait()


@pytest.fixture
def shared_memory():
    """Checks that nothing is added to the named shared memory."""
    before = segments()
    yield
    assert segments() <= before


@pytest.mark.parametrize(
    "ending", ["", *(pytest.param(words, marks=pytest.mark.slow) for words in ("env.close()", "raise SystemExit(0)"))]
)
def test_a_plain_script(tmp_path, shared_memory, ending):
    """Without a guard for the main module, and without closing: it runs once, says nothing, and leaves nothing."""
    process = _start(tmp_path, ending)
    pids = _workers(process)
    assert len(pids) == 2
    assert _finish(process) == ("", "")
    assert process.returncode == 0
    assert gone(pids, 1.0)
    assert (tmp_path / "runs").read_text() == "run\n"
    assert list((tmp_path / "tmp").iterdir()) == []


def test_a_killed_parent(tmp_path, shared_memory):
    """`kill -9`: the workers, one of them stopped, go with it."""
    process = _start(tmp_path, WAIT)
    pids = _workers(process)
    assert all(map(alive, pids))
    os.kill(pids[1], signal.SIGSTOP)
    process.kill()
    _finish(process)
    assert gone(pids)


@pytest.mark.parametrize("more", WAYS)
def test_a_parent_that_is_asked_to_end(tmp_path, shared_memory, more):
    """SIGTERM, which ends a Python program at once."""
    process = _start(tmp_path, more)
    pids = _workers(process)
    process.terminate()
    _finish(process)
    assert process.returncode == -signal.SIGTERM
    assert gone(pids)


@pytest.mark.parametrize("more", WAYS)
def test_ctrl_c(tmp_path, shared_memory, more):
    """SIGINT to the whole group, as a terminal sends it: one traceback, that of the program, and nothing is left."""
    process = _start(tmp_path, more, start_new_session=True)
    pids = _workers(process)
    time.sleep(0.3)
    os.killpg(process.pid, signal.SIGINT)
    _, said = _finish(process)
    assert process.returncode == -signal.SIGINT
    assert said.count("Traceback") == 1
    assert said.rstrip().endswith("KeyboardInterrupt")
    assert gone(pids)
    assert list((tmp_path / "tmp").iterdir()) == []


def test_ctrl_c_that_is_caught(tmp_path, shared_memory):
    """A program that goes on after Ctrl-C has its workers still."""
    process = _start(
        tmp_path,
        """
        import numpy as np
        import warnings
        warnings.simplefilter("error")
        try:
            while True:
                env.engine.step(10)
        except KeyboardInterrupt:
            env.reset(seed=2)
            env.step(np.zeros((4, env.action_dim)))
            print(*env.engine.workers, flush=True)
        """,
        start_new_session=True,
    )
    pids = _workers(process)
    time.sleep(0.3)
    os.killpg(process.pid, signal.SIGINT)
    said, complaints = _finish(process)
    assert complaints == ""
    assert [int(pid) for pid in said.split()] == pids
    assert gone(pids)


@pytest.mark.slow
def test_a_fork_does_not_keep_the_workers(tmp_path, shared_memory):
    """A fork of the program that lives on holds nothing that the workers wait for, and ends without ending them."""
    process = _start(
        tmp_path,
        """
        import os, time
        child = os.fork()
        if child == 0:
            time.sleep(3.0)
            os._exit(0)
        short = os.fork()
        if short == 0:
            sys.exit(0)
        os.waitpid(short, 0)
        env.engine.step(10)
        print(child, bool(env.engine.get_state().fault.any()), flush=True)
        sys.stdin.read()
        """,
    )
    pids = _workers(process)
    child, fault = process.stdout.readline().split()
    assert fault == "False"
    process.kill()
    assert gone(pids, 2.0)
    assert alive(int(child))
    os.kill(int(child), signal.SIGKILL)
    _finish(process)
    assert gone([int(child)])


def test_the_module_of_the_worker_is_light():
    """A worker imports what it needs: starting one costs little more than Python and numpy."""
    code = (
        "import sys; import anysim_sharded.worker; "
        "loaded = {name.split('.')[0] for name in sys.modules}; "
        "assert not loaded & {'mujoco', 'pybullet', 'sapien', 'scipy', 'trimesh', 'numba', 'typer'}, loaded"
    )
    subprocess.run([sys.executable, "-c", code], cwd=Path.home(), check=True)


def test_workers_are_kept_for_the_next_engine_where_that_is_asked_for():
    """The same processes serve engines of one kind one after the other, and end with the block."""
    before, world, kind = children(), worlds.scene(), sharded(NullEngine, 2)
    with NullEngine() as alone:
        wanted = read(alone.create_world(world, 2))
    with keeping_workers():
        seen = []
        for _ in range(2):
            with kind() as engine:
                assert_same(read(engine.create_world(world, 2)), wanted, "the start")
                engine.step(5)
                seen.append(engine.workers)
        with kind() as engine:
            engine.create_world(world, 2)
            os.kill(engine.workers[0], signal.SIGKILL)
        with kind() as engine:
            seen.append(engine.create_world(world, 2).workers)
        assert seen[0] == seen[1]
        assert not set(seen[0]) & set(seen[2]), "a pool with a lost worker is not kept"
        assert children() - before == set(seen[2])
    assert children() == before


@pytest.mark.parametrize("sent", [True, False])
def test_a_call_that_is_interrupted_leaves_no_answer_to_the_next(sent, monkeypatch):
    """Ctrl-C right after a message was sent, or right before: the next call gets its own answer."""
    real, armed = Connection.send, []

    def send(connection, message):
        if sent or not armed:
            real(connection, message)
        if armed:
            armed.clear()
            raise KeyboardInterrupt

    with NullEngine() as alone, sharded(NullEngine, 2)() as engine:
        for one in (alone, engine):
            one.create_world(worlds.scene(), 4)
        monkeypatch.setattr(Connection, "send", send)
        armed.append(True)
        with pytest.raises(KeyboardInterrupt):
            engine.step(3)
        assert np.array_equal(engine.get_parameters("body.mass"), alone.get_parameters("body.mass"))
        for one in (alone, engine):
            one.reset()
            one.step(2)
        assert_same(read(engine), read(alone), "after the interruption")
