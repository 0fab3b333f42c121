"""The contract suite finds every wrong engine by the tests that are named for its defect, and clears the right ones."""

import importlib
import importlib.util
import inspect
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.xdist_group("wrong engines")  # one worker runs them, once, for all tests

HERE = Path(__file__).parent
KINEMATIC = ("wrong_engines", "wrong_states")
PHYSICAL = ("wrong_physics",)
HAS_MUJOCO = importlib.util.find_spec("mujoco") is not None


def _wrong(modules):
    """The engines with a defect: `module:Class` and the tests that find it."""
    found = {}
    for name in modules:
        for class_name, thing in inspect.getmembers(importlib.import_module(name), inspect.isclass):
            tests = getattr(thing, "caught_by", ())
            if tests and thing.__module__ == name:
                found[f"{name}:{class_name}"] = tests
    return found


with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(HERE)  # the modules are known to the child process by these names, too
    DEFECTS = _wrong(KINEMATIC)
    PHYSICS = _wrong(PHYSICAL) if HAS_MUJOCO else {}


def _outcomes(jobs, right, folder):
    """Run each wrong engine on its tests, and the right one on all of them."""
    jobs = {name: list(tests) for name, tests in jobs.items()}
    jobs[right] = sorted({test for tests in jobs.values() for test in tests})
    (folder / "jobs.json").write_text(json.dumps(jobs))
    command = [sys.executable, str(HERE / "run_engines.py"), str(folder / "jobs.json"), str(folder / "results.json")]
    path = os.pathsep.join([str(HERE), *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = os.environ | {"PYTHONPATH": path}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
    return json.loads((folder / "results.json").read_text())


def _check(outcomes, tests, wanted):
    assert {test: outcomes.get(test, "not run") for test in tests} == dict.fromkeys(tests, wanted)


@pytest.fixture(scope="module")
def kinematic(tmp_path_factory):
    return _outcomes(DEFECTS, "right_engine:Right", tmp_path_factory.mktemp("kinematic"))


@pytest.mark.parametrize("name", DEFECTS)
def test_defect_is_caught(kinematic, name):
    _check(kinematic[name], DEFECTS[name], "failed")


def test_the_right_engine_passes_the_same_tests(kinematic):
    # rays and dynamics are what two of the wrong engines only claim
    claimed = {*DEFECTS["wrong_states:BlindRays"], *DEFECTS["wrong_states:ClaimsDynamics"]}
    passed = {test for tests in DEFECTS.values() for test in tests} - claimed
    _check(kinematic["right_engine:Right"], passed, "passed")
    _check(kinematic["right_engine:Right"], claimed, "skipped")


# ---------------------------------------------------------------------- physics, on MuJoCo

needs_mujoco = pytest.mark.skipif(not HAS_MUJOCO, reason="wrong physics is made from MuJoCo's, which is not installed")


@pytest.fixture(scope="module")
def physical(tmp_path_factory):
    return _outcomes(PHYSICS, "wrong_physics:Right", tmp_path_factory.mktemp("physical"))


@needs_mujoco
@pytest.mark.parametrize("name", PHYSICS)
def test_wrong_physics_is_caught(physical, name):
    _check(physical[name], PHYSICS[name], "failed")


@needs_mujoco
def test_right_physics_passes_the_same_tests(physical):
    _check(physical["wrong_physics:Right"], {test for tests in PHYSICS.values() for test in tests}, "passed")
