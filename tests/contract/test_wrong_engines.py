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

from anysim.engine.capability import Capability

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("wrong engines")]  # one worker runs them, once, for all tests

HERE = Path(__file__).parent
KINEMATIC = ("wrong_engines", "wrong_states")
PHYSICAL, CLAIMING = ("wrong_physics",), ("wrong_claims", "wrong_couplings", "wrong_magnitudes")
CLAIMED = {
    Capability.RIGID_BODIES: ("ClaimsRigidBodies",),
    Capability.ARTICULATIONS: ("ClaimsArticulations",),
    Capability.CONTACTS_STATIC: ("ClaimsStaticContacts",),
    Capability.CONTACTS_MOVING: ("ClaimsMovingContacts",),
    Capability.TERRAIN_PLANE: ("ClaimsPlanes",),
    Capability.TERRAIN_HEIGHTFIELD: ("ClaimsHeightFields", "TurnedField"),
    Capability.TERRAIN_TRIMESH: ("ClaimsTriangles",),
    Capability.SHAPE_MESH: ("ClaimsMeshes", "CentredMesh"),
    Capability.MIMIC_JOINTS: ("ClaimsMimics", "MimicsStayBehind"),
    Capability.MIMIC_CURVES: ("ClaimsCurves",),
    Capability.TENDONS: ("ClaimsTendons", "TautTendons"),
    Capability.TENDON_LIMITS: ("ClaimsTendonLimits",),
    Capability.TENDON_DRIVES: ("ClaimsTendonDrives",),
    Capability.SPATIAL_TENDONS: ("ClaimsSpatialTendons",),
    Capability.CONNECTS: ("ClaimsConnects",),
    Capability.WELDS: ("ClaimsWelds",),
    Capability.JOINT_FRICTION: ("ClaimsJointFriction",),
    Capability.JOINT_SPRINGS: ("ClaimsJointSprings", "SpringsToZero"),
    Capability.ARMATURE: ("StoredArmature", "NoArmature"),
    Capability.JOINT_LIMITS: ("ClaimsJointLimits",),
    Capability.EFFORT_LIMITS: ("NoEffortLimit", "StoredLimits"),
    Capability.GRAVITY_COMPENSATION: ("ClaimsCompensation", "CompensatesLinksAlone"),
    Capability.RESTITUTION: ("NoBounce", "StoredRestitution"),
    Capability.TORSIONAL_FRICTION: ("ClaimsTorsionalFriction",),
    Capability.COMPLIANCE: ("ClaimsCompliance",),
    Capability.BODY_DAMPING: ("ClaimsBodyDamping",),
    Capability.SOLVER_SETTINGS: ("ClaimsSolverSettings",),
    Capability.CONTROL_POSITION: ("ClaimsPositionControl", "WeakDrives"),
    Capability.CONTROL_VELOCITY: ("ClaimsVelocityControl",),
    Capability.CONTROL_EFFORT: ("ClaimsEffortControl",),
    Capability.ACTUATION_EXPLICIT: ("ClaimsExplicitActuation",),
    Capability.ACTUATION_NATIVE: ("ClaimsNativeActuation",),
    Capability.VELOCITY_LIMITS: ("ClaimsVelocityLimits",),
    Capability.WRENCHES: ("ClaimsWrenches",),
    Capability.CONTACT_SENSORS: ("ClaimsContactSensors",),
    Capability.CONTACT_POINTS: ("ClaimsContactPoints",),
    Capability.RAYCAST: ("ClaimsRays", "BlindRays"),
    Capability.RENDER_RGB: ("ClaimsColour",),
    Capability.RENDER_DEPTH: ("ClaimsDepth",),
    Capability.RENDER_SEGMENTATION: ("ClaimsSegmentation",),
    Capability.RENDER_SHADOWS: ("ClaimsShadows",),
    Capability.RENDER_LIGHTS: ("ClaimsSeveralLights", "ClaimsLamps"),
    Capability.TEXTURES: ("ClaimsTextures",),
    Capability.MATERIALS: ("ClaimsMaterials",),
    Capability.SNAPSHOT_STATE: ("ClaimsSnapshots",),
    Capability.SNAPSHOT_TRAJECTORY: ("ClaimsExactSnapshots",),
    Capability.VARYING_ENTITIES: ("Ghosts", "ClaimsToDelete"),
    Capability.PARAMETERS_PER_ENV: ("StoredMass", "ParametersOfAll"),
    Capability.DYNAMICS: ("ClaimsDynamics",),
}
"""By capability the wrong engines that declare it and do not have it."""

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
    PHYSICS, CLAIMS = (_wrong(modules) if HAS_MUJOCO else {} for modules in (PHYSICAL, CLAIMING))


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
    # rays, dynamics and pictures are what some of the wrong engines only claim
    claimed = {
        test for name in ("BlindRays", "ClaimsDynamics", "ClaimsPictures") for test in DEFECTS[f"wrong_states:{name}"]
    }
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


# ---------------------------------------------------------------------- false declarations and impossible states


@pytest.fixture(scope="module")
def claiming(tmp_path_factory):
    return _outcomes(CLAIMS, "wrong_physics:Right", tmp_path_factory.mktemp("claiming"))


@needs_mujoco
@pytest.mark.slow
@pytest.mark.parametrize("name", CLAIMS)
def test_a_false_claim_is_caught(claiming, name):
    _check(claiming[name], CLAIMS[name], "failed")


@needs_mujoco
@pytest.mark.slow
def test_right_physics_claims_what_it_does(claiming):
    claimed = {*CLAIMS["wrong_claims:ClaimsSolverSettings"]}
    passed = {test for tests in CLAIMS.values() for test in tests} - claimed
    _check(claiming["wrong_physics:Right"], passed, "passed")
    _check(claiming["wrong_physics:Right"], claimed, "skipped")


@needs_mujoco
def test_every_capability_is_claimed_by_a_wrong_engine():
    """A capability that can be declared falsely without a test that fails would be worth nothing."""
    wrong = {name.rpartition(":")[2] for name in (*DEFECTS, *PHYSICS, *CLAIMS)}
    assert set(CLAIMED) == set(Capability)
    assert {name for names in CLAIMED.values() for name in names} <= wrong
