"""Processes that held an engine, and its messages when something is wrong."""

import os
import subprocess
import sys
import tempfile
import textwrap
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from anysim.api import compile_world
from anysim.c_output import quiet
from anysim.engine.factory import create_simulation
from anysim.errors import EngineError
from anysim.model.world import Plane
from anysim.testing import worlds
from anysim_pybullet import declared
from anysim_pybullet.options import PybulletOptions, sweeps


def _run(code: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)], cwd=cwd, capture_output=True, text=True, timeout=120
    )


def test_a_whole_life_is_silent(tmp_path):
    """Bullet prints its build time, and what it thinks of files and states, to both streams."""
    done = _run(
        """
        import numpy as np
        from anysim.testing import worlds
        from anysim.engine.factory import create_simulation
        engine = create_simulation("pybullet").create_world(worlds.scene(cameras=True), 2)
        engine.step(5)
        snapshot = engine.snapshot()
        engine.render("front")
        engine.set_body_state(twist=np.full(6, 1e12), bodies=[engine.index.body("ball")])
        engine.step(20)
        assert engine.get_state().fault.all()
        engine.restore(snapshot)
        assert not engine.get_state().fault.any()
        engine.reset()
        engine.destroy()
        """,
        tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert done.stderr == ""
    assert list(tmp_path.iterdir()) == []


def test_naming_the_engine_loads_no_library(tmp_path):
    """Its class and its availability load neither PyBullet nor numba."""
    done = _run(
        """
        import sys
        from anysim import registry
        engine = registry.load("engines", "pybullet")
        assert engine.availability().available
        assert not {"pybullet", "numba"} & set(sys.modules)
        """,
        tmp_path,
    )
    assert done.returncode == 0, done.stderr


def test_files_are_removed(monkeypatch, tmp_path):
    """The files that Bullet builds from go with the engine, also where the build fails."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    engine = create_simulation("pybullet").create_world(worlds.scene(), 2)
    assert len(list(tmp_path.iterdir())) == 1
    engine.destroy()
    assert list(tmp_path.iterdir()) == []
    world = worlds.scene()
    on_a_body = replace(world.geoms[1], name="odd", shape=Plane(), body=1)
    with pytest.raises(EngineError, match=r"a Plane to the world alone; geom 'odd'"):
        create_simulation("pybullet").create_world(replace(world, geoms=(*world.geoms, on_a_body)))
    assert list(tmp_path.iterdir()) == []


def test_bullets_words_are_in_the_error(monkeypatch):
    """A world that Bullet refuses is an EngineError with what Bullet printed."""
    from anysim_pybullet import client

    monkeypatch.setattr(client, "tree_urdf", lambda *_: "<robot name='x'><link name='a'><link name='b'></robot>")
    with pytest.raises(EngineError, match=r"Bullet cannot build the world 'scene': Cannot load URDF file.*; .+"):
        create_simulation("pybullet").create_world(worlds.scene())


def test_quiet_gives_the_streams_back(capfd):
    """What C code writes inside is kept, what is written after it is seen."""
    with quiet() as words:
        os.write(1, b"inside\n")
    os.write(1, b"after\n")
    assert words.text == "inside\n"
    assert words.tail == "inside"
    assert capfd.readouterr().out == "after\n"


@pytest.mark.parametrize(
    ("version", "missing"), [("", "is not installed"), ("3.2.6", "older than 3.2.7"), ("3.2.7", None)]
)
def test_availability(monkeypatch, version, missing):
    """A version that is missing or too old is said, with the remedy."""
    monkeypatch.setattr("anysim.engine.availability.installed_version", lambda _: version)
    here = declared.LIBRARY.availability()
    assert here.available == (missing is None)
    if missing:
        assert missing in here.missing[0]
        assert "pip install" in here.remedy


def test_unknown_options_are_refused():
    """Options are checked by name."""
    with pytest.raises(EngineError, match="no option 'iteration'; did you mean 'iterations'"):
        create_simulation("pybullet", iteration=3)


@pytest.mark.parametrize(
    ("robot", "usual"), [("franka_panda", 50), pytest.param("tiago_pro", 100, marks=pytest.mark.slow)]
)
def test_linkages_get_more_sweeps(robot, usual):
    """The Panda has one finger that follows, a gripper of TIAGo Pro five joints."""
    world = compile_world({"world": {"robots": {"r": {"robot": robot}}}})
    assert sweeps(PybulletOptions(), world) == usual
    assert sweeps(PybulletOptions(iterations=7), world) == 7


def test_options_that_shape_runs_are_in_the_version():
    """Snapshots of differently tuned engines do not mix."""
    assert create_simulation("pybullet", iterations=100).version.endswith("(iterations=100)")
    assert np.all([c.isdigit() or c == "." for c in create_simulation("pybullet", shadows=True).version])
