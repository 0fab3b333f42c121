"""The shipped contract suite, run as its users run it: in its own process, by package name."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from anysim.testing.engines import require_engine
from tests import forked

ROOT = Path(__file__).parents[2]
SUMMARY = re.compile(
    r"anysim contract: engine (\S+) (\S+?)(?: in \d+ shards)?: "
    r"(\d+) passed(?:, (\d+) failed)?, (\d+) skipped(?: \((.*)\))?"
)


WORDS = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "--tb=short", "--pyargs", "anysim.testing")


def _run(folder, *options):
    return forked.run(*WORDS, *options, cwd=folder, timeout=900)


def _summary(done):
    found = SUMMARY.search(done.stdout)
    assert found, done.stdout[-4000:] + done.stderr[-4000:]
    assert found[4] is None, done.stdout[-8000:]
    assert done.returncode == 0, done.stdout[-4000:]
    return int(found[3]), int(found[5]), found[6] or ""


def _counts(why):
    """How many were skipped for each reason, which may name several needs: `one, two: 3`."""
    return {reason: int(count) for reason, count in re.findall(r"(.+?): (\d+)(?:, |$)", why)}


def test_the_null_engine_passes(tmp_path):
    passed, skipped, why = _summary(_run(tmp_path, "--engine", "null"))
    assert passed > 215
    counts = _counts(why)
    couplings = {"connects", "fixed tendons: drives", "mimic joints: curves", "welds"}
    assert set(counts) == {"dynamics", "external wrenches", "raycast", "render: rgb", *couplings}
    assert sum(counts.values()) == skipped


def test_the_smallest_engine_with_one_world_per_env_passes():
    passed, skipped, _ = _summary(_run(ROOT, "--engine", "tests.engine.drifting:DriftingEngine"))
    assert passed > 35
    assert skipped > 400


def test_an_honest_limited_engine_passes():
    """Spheres on a plane, without joints, pictures and parameters: green, and it is said what was skipped for what."""
    passed, skipped, why = _summary(_run(ROOT, "--engine", "tests.contract.limited_engine:MarbleEngine"))
    assert passed > 30
    assert skipped > 400
    assert {"articulations", "render: rgb", "contacts between moving bodies", "marbles refuses 'slope'"} <= {
        part.rpartition(": ")[0] for part in why.split(", ")
    }


LONG = "not (test_modes or pendulum or declared or test_joint_limits)"
"""The example computes each step in Python: without the longest motions it takes a third of the time."""


@pytest.mark.parametrize(
    "words", [pytest.param(("-k", LONG), marks=pytest.mark.slow), pytest.param((), marks=pytest.mark.full)]
)
def test_the_articulated_example_passes(words):
    """Joints with drives and limits, in a package of its own; nothing touches anything, so most worlds are skipped."""
    folder = ROOT / "tests" / "external" / "anysim-linkage"
    passed, skipped, why = _summary(_run(folder, "--engine", "anysim_linkage.engine:LinkageEngine", *words))
    assert passed > (30 if words else 40)
    assert "rigid bodies: " in why
    assert skipped > 400


COUPLED = {"fixed tendons: drives", "fixed tendons: limits, dry friction and armature", "mimic joints: curves"} | {
    "spatial tendons"
}
"""What MuJoCo alone has."""
DYNAMIC = {
    "mujoco": {"render: rgb", "solver settings by entity", "terrain: triangle mesh (concave)"},
    "pybullet": COUPLED | {"render: rgb", "solver settings by entity", "parameter world.shadows"},
    "sapien": COUPLED | {"render: rgb", "render: shadows", "parameter world.shadows"},
}
"""The engines of the repository that move things, and for want of what a test of theirs may be skipped."""


@pytest.mark.slow
@pytest.mark.parametrize("name", DYNAMIC)
def test_an_engine_with_dynamics_passes(name, tmp_path):
    require_engine(name)
    passed, _, why = _summary(_run(tmp_path, "--engine", name))
    assert passed >= 251
    _passes(name, why)


PROCESSES = "test_lifecycle or test_stepping or test_snapshots"
"""What of the contract worker processes could break; what is computed in them is compared in tests/plugins/sharded."""


def test_an_engine_with_dynamics_passes_a_part(tmp_path):
    """Where the order of calls, states and their copies are: a third of what dynamics are tried with."""
    require_engine("mujoco")
    passed, _, why = _summary(_run(tmp_path, "--engine", "mujoco", "-k", PROCESSES))
    assert passed >= 60
    _passes("mujoco", why)


@pytest.mark.full
def test_an_engine_in_worker_processes_passes(tmp_path):
    """The whole contract is kept in two shards too: nothing can be seen of them but the processes."""
    done = _run(tmp_path, "--engine", "null", "--shards", "2")
    assert " in 2 shards: " in done.stdout
    assert _summary(done)[0] > 215


@pytest.mark.full
@pytest.mark.parametrize("name", DYNAMIC)
def test_an_engine_with_dynamics_lives_in_worker_processes(name, tmp_path):
    require_engine(name)
    done = _run(tmp_path, "--engine", name, "--shards", "2", "-k", PROCESSES)
    assert " in 2 shards: " in done.stdout
    passed, _, why = _summary(done)
    assert passed >= 60
    _passes(name, why)


def _passes(name, why):
    """Nothing was skipped but for want of what the engine does without."""
    for reason in _counts(why):
        assert "cannot draw here" in reason or reason in DYNAMIC[name], reason


def test_without_an_engine_it_says_how(tmp_path):
    done = forked.run(*WORDS, cwd=tmp_path)
    assert done.returncode == pytest.ExitCode.USAGE_ERROR
    assert "--engine NAME" in done.stdout + done.stderr


def test_an_unknown_engine_lists_what_exists(tmp_path):
    done = forked.run(*WORDS, "--engine", "nul", cwd=tmp_path)
    assert done.returncode == pytest.ExitCode.USAGE_ERROR
    assert "did you mean 'null'" in done.stdout + done.stderr


def test_options_reach_the_engine(tmp_path):
    words = (*WORDS, "--engine", "null", "--engine-option", "colour=red", "-k", "test_context_manager_destroys")
    done = forked.run(*words, cwd=tmp_path)
    assert "null takes no options, got colour" in done.stdout


def test_the_plugin_costs_nothing_without_an_engine(tmp_path):
    """It is loaded in every pytest run on the machine: it must not import numpy or the engines."""
    code = (
        "import sys; before = set(sys.modules); import anysim.testing.plugin; "
        "new = {m.split('.')[0] for m in set(sys.modules) - before}; "
        "assert not new & {'numpy', 'pydantic', 'mujoco'}, new; assert 'anysim.engine' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True)
