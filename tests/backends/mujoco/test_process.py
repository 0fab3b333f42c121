"""Processes that held an engine: nothing of it is left behind."""

import contextlib
import ctypes
import gc
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest

from anysim.engine.factory import create_simulation
from anysim.errors import EngineError
from tests.tiers import often


def _run(code: str, cwd: Path, **env: str) -> subprocess.CompletedProcess[str]:
    clean = {k: v for k, v in os.environ.items() if k not in ("MUJOCO_GL", "PYOPENGL_PLATFORM")}
    return subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        cwd=cwd,
        env=clean | env,
        capture_output=True,
        text=True,
        timeout=120,
    )


DIVERGE = """
    import numpy as np, os
    from anysim.engine.factory import create_simulation
    from anysim.model.world import Body, BodyKind, Entity, EntityKind, Geom, Inertial, Plane, Sphere, World
    inertial = Inertial(1.0, inertia=(0.1, 0.1, 0.1, 0, 0, 0))
    ball = Body("ball", BodyKind.FREE, position=(0.0, 0.0, 1.0), inertial=inertial)
    world = World(bodies=(ball,), geoms=(Geom("g", -1, Plane()), Geom("b", 0, Sphere(0.1))),
                  entities=(Entity("ball", EntityKind.OBJECT, 0, 1, 0, 0),))
    engine = create_simulation("mujoco").create_world(world, 2)
"""


def test_a_fault_writes_no_log_and_no_word(tmp_path):
    """MuJoCo would write MUJOCO_LOG.TXT into the working directory and warn on the terminal."""
    done = _run(
        DIVERGE
        + """
    engine.set_body_state(twist=np.full((2, 1, 6), 1e12))
    engine.step(20)
    assert engine.get_state().fault.all()
    """,
        tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert done.stderr == ""
    assert list(tmp_path.iterdir()) == []


NAN = '<mujoco><worldbody><body name="it"><geom size="0.1" {}/></body></worldbody></mujoco>'


@pytest.mark.parametrize("attribute", ['pos="nan 0 0"', 'mass="nan"', 'rgba="1 1 1 nan"', 'user="nan"'])
def test_a_file_with_nan_leaves_no_log_and_no_word(tmp_path, attribute):
    """Read by the importer and by what robots are held against; no engine was made before."""
    (tmp_path / "it.xml").write_text(NAN.format(attribute))
    done = _run(
        """
    from pathlib import Path
    from anysim.assets.load import import_asset
    from anysim.errors import AnysimError
    from anysim_mujoco.oracle import Mjcf
    file = Path("it.xml").resolve()
    for read in (lambda: import_asset(str(file)), lambda: Mjcf(file, file.parent)):
        try:
            read()
        except AnysimError:
            pass
    """,
        tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout + done.stderr == ""
    assert [path.name for path in tmp_path.iterdir()] == ["it.xml"]


@pytest.mark.parametrize(
    "ending", often(["", "os._exit is None"], ["", "engine.destroy()", "os._exit is None", "raise SystemExit(0)"])
)
def test_drawing_leaves_the_environment_and_the_exit_clean(tmp_path, ending):
    """No environment variable is set, and no traceback comes out of a destructor at exit."""
    done = _run(
        DIVERGE
        + f"""
    before = dict(os.environ)
    from anysim.errors import CannotDraw
    try:
        engine.render("default", 64, 64)
    except CannotDraw:
        pass
    assert dict(os.environ) == before
    {ending}
    """,
        tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert done.stderr == ""
    assert list(tmp_path.iterdir()) == []


def test_a_machine_without_opengl_says_what_to_install(tmp_path):
    """Both backends fail; each says why, and the remedy follows."""
    done = _run(
        DIVERGE
        + """
    import sys
    class Blocked:
        def find_spec(self, name, path=None, target=None):
            if name.split(".")[0] == "OpenGL":
                raise ImportError("no OpenGL here")
    sys.meta_path.insert(0, Blocked())
    from anysim.errors import EngineError
    for _ in range(2):
        try:
            engine.render()
        except EngineError as error:
            print(error)
    engine.step(5)
    """,
        tmp_path,
    )
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) == 2
    assert lines[0] == lines[1]
    assert (
        "MuJoCo cannot draw here (egl: no OpenGL here; osmesa: no OpenGL here); install a software renderer" in lines[0]
    )


@pytest.mark.parametrize(
    ("variable", "option", "tried"),
    [
        ("", "auto", ("egl", "osmesa")),
        ("osmesa", "auto", ("osmesa",)),
        ("glfw", "auto", ("egl", "osmesa")),
        ("osmesa", "egl", ("egl",)),
    ],
)
def test_mujoco_gl_is_respected(monkeypatch, variable, option, tried):
    """A user's MUJOCO_GL names the one backend to try, unless the option does; glfw needs a screen."""
    from anysim_mujoco.gl import _order

    monkeypatch.setenv("MUJOCO_GL", variable)
    assert _order(option) == tried


def test_the_package_and_availability_import_nothing_heavy(tmp_path):
    """The declarations do not need MuJoCo."""
    done = _run(
        """
    import sys
    import anysim_mujoco, anysim_mujoco.declared
    assert anysim_mujoco.declared.LIBRARY.availability().available
    assert not {"mujoco", "OpenGL"} & set(sys.modules)
    """,
        tmp_path,
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("installed", "version", "word", "remedy"),
    [
        ({}, "", "the package mujoco is not installed", "pip install 'mujoco>="),
        ({"mujoco": "3.16.2"}, "3.16.2", "mujoco.batch", "pip install 'mujoco>="),
        ({"mujoco": "4.0.0"}, "4.0.0", "mujoco 4.0.0 is unusable: its sparse solver", "pip install 'mujoco>="),
        ({"mujoco": "3.17.0"}, "3.17.0", "", ""),
        ({"mujoco": "4.0.1"}, "4.0.1", "", ""),
        ({"mujoco": "4.1"}, "4.1", "", ""),
        ({"mujoco-core": "4.0.1"}, "4.0.1", "", ""),
        ({"mujoco-core": "4.0.0"}, "4.0.0", "mujoco-core 4.0.0 is unusable: its sparse", "pip install 'mujoco-core>="),
        (
            {"mujoco": "3.17.0", "mujoco-core": "4.0.1"},
            "3.17.0",
            "mujoco 3.17.0 and mujoco-core 4.0.1 are installed, and each has overwritten files of the other: keep one",
            "pip uninstall -y mujoco mujoco-core, then pip install 'mujoco>=",
        ),
        # from 4.0 on `mujoco` is a name for `mujoco-core` of the same version and what it does not need
        ({"mujoco": "4.0.1", "mujoco-core": "4.0.1"}, "4.0.1", "", ""),
        (
            {"mujoco": "4.0.0", "mujoco-core": "4.0.0"},
            "4.0.0",
            "sparse solver",
            "pip uninstall -y mujoco mujoco-core, then pip install 'mujoco>=",
        ),
    ],
)
def test_availability_by_what_is_installed(monkeypatch, installed, version, word, remedy):
    """Known-bad and too old versions, and two of them at once, come with the remedy."""
    from anysim_mujoco import declared

    monkeypatch.setattr("anysim.engine.availability.installed_version", lambda name: installed.get(name, ""))
    here = declared.LIBRARY.availability()
    assert here.available is (word == "")
    assert here.version == version
    assert word in " ".join(here.missing)
    assert here.remedy.startswith(remedy)
    assert ("pip install" in here.remedy) is not here.available


def _resident_mb() -> float:
    """Resident memory, after the allocator gave back what is free: its caches per thread would look like a leak."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "malloc_trim"), reason="needs glibc, to tell a leak from its caches")
def test_fifty_engines_leave_no_memory_behind(worlds):
    """Built, stepped, drawn, destroyed."""

    def once() -> None:
        with create_simulation("mujoco") as engine:
            engine.create_world(worlds.scene(), 4)
            engine.set_parameters("body.mass", engine.get_parameters("body.mass"))
            engine.step(5)
            with contextlib.suppress(EngineError):  # where there is no OpenGL
                engine.render("default", 64, 64)

    def grown(engines: int) -> float:
        before = _resident_mb()
        for _ in range(engines):
            once()
        return _resident_mb() - before

    grown(5)
    rounds = [grown(17) for _ in range(3)]  # a leak grows in each; drivers fill their caches in some
    assert min(rounds) < 5, f"{rounds} MiB"


def test_a_destroyed_engine_holds_no_arrays(worlds):
    """Arrays that were read live on; the engine lets go of its own."""
    engine = create_simulation("mujoco").create_world(worlds.scene(), 2)
    pose = engine.get_state().body_pose
    copy = pose.copy()
    engine.destroy()
    engine.destroy()
    assert np.array_equal(pose, copy)
    with pytest.raises(EngineError, match="was destroyed"):
        engine.step()
