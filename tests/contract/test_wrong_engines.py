"""The contract suite finds every wrong engine by the tests that are named for its defect, and clears the right ones."""

import importlib.util
import inspect
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent


def _load(name):
    """A module beside this file, under the name by which the child process knows it."""
    spec = importlib.util.spec_from_file_location(name, HERE / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _wrong(name):
    """The engines of a module that have a defect, by class name."""
    module = _load(name)
    return {n: c for n, c in inspect.getmembers(module, inspect.isclass) if c.__module__ == name and c.caught_by}


def _outcomes(name, folder):
    """Run each wrong engine on its tests, and the right one on all of them."""
    jobs = {f"{name}:{n}": list(c.caught_by) for n, c in _wrong(name).items()}
    jobs[f"{name}:Right"] = sorted({test for tests in jobs.values() for test in tests})
    (folder / "jobs.json").write_text(json.dumps(jobs))
    command = [sys.executable, str(HERE / "run_engines.py"), str(folder / "jobs.json"), str(folder / "results.json")]
    path = os.pathsep.join([str(HERE), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(command, cwd=folder, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
    return json.loads((folder / "results.json").read_text())


def _check(outcomes, key, tests, wanted):
    got = {test: outcomes[key].get(test, "not run") for test in tests}
    assert got == dict.fromkeys(tests, wanted)


@pytest.fixture(scope="module")
def kinematic(tmp_path_factory):
    return _outcomes("wrong_engines", tmp_path_factory.mktemp("kinematic"))


@pytest.mark.parametrize("name", _wrong("wrong_engines"))
def test_defect_is_caught(kinematic, name):
    _check(kinematic, f"wrong_engines:{name}", _wrong("wrong_engines")[name].caught_by, "failed")


def test_the_right_engine_passes_the_same_tests(kinematic):
    outcomes = kinematic["wrong_engines:Right"]
    # rays and dynamics are what two of the wrong engines only claim
    claimed = {t for c in ("BlindRays", "ClaimsDynamics") for t in _wrong("wrong_engines")[c].caught_by}
    assert {test: out for test, out in outcomes.items() if test not in claimed and out != "passed"} == {}
    assert {outcomes[test] for test in claimed} == {"skipped"}


# ---------------------------------------------------------------------- physics, on MuJoCo

HAS_MUJOCO = importlib.util.find_spec("mujoco") is not None
needs_mujoco = pytest.mark.skipif(not HAS_MUJOCO, reason="wrong physics is made from MuJoCo's, which is not installed")
PHYSICS = _wrong("wrong_physics") if HAS_MUJOCO else {}


@pytest.fixture(scope="module")
def physical(tmp_path_factory):
    return _outcomes("wrong_physics", tmp_path_factory.mktemp("physical"))


@needs_mujoco
@pytest.mark.parametrize("name", PHYSICS)
def test_wrong_physics_is_caught(physical, name):
    _check(physical, f"wrong_physics:{name}", PHYSICS[name].caught_by, "failed")


@needs_mujoco
def test_right_physics_passes_the_same_tests(physical):
    assert {test: out for test, out in physical["wrong_physics:Right"].items() if out != "passed"} == {}
