"""Pinches: pads that press on cloth with a force, and hold by friction what that is enough for."""

from typing import Any

import numpy as np
import pytest

import anysim
from anysim.skills.base import OUTCOMES, Outcome
from anysim.testing.engines import require_engine
from anysim_garments.grasp import ClothGrasp
from tests.plugins.soft.softs import ALL, ENGINES, begun, run_of

EACH = pytest.mark.parametrize("engine", ["mujoco", *(pytest.param(e, marks=pytest.mark.slow) for e in ENGINES[1:])])
PAD = {"tool": "panda.tool", "joint": "panda.panda_finger_joint1", "closed": 0.008, "grip": "pinch", "force": 20.0}
PANDA = {"robot": "franka_panda", "actions": {"arm": "joint_delta_position", "eef": "gripper_binary"}}
CLOSE, OPEN = np.array([[0.0] * 7 + [-1.0]]), np.array([[0.0] * 7 + [1.0]])
STRIP: dict[str, Any] = {"kind": "garment", "towel": [0.24, 0.12], "spacing": 0.03, "areal_density": 8.0, "substeps": 2}
STRIP |= {"position": [0.5, 0.0, 0.24], "tilt": np.pi / 2, "yaw": np.pi / 2, "drag": 40.0}
"""Upright between open fingers: air as thick as this lets it sink by a decimetre until they have closed."""


def strip(change: dict[str, Any] | None = None, engine: str = "mujoco", **pad: Any) -> dict[str, Any]:
    cloth = {**STRIP, "pads": {"hand": {**PAD, **pad}}, **(change or {})}
    return run_of(cloth, engine, {"robots": {"panda": PANDA}})


def go(env: anysim.TaskEnv, action: np.ndarray, steps: int) -> None:
    for _ in range(steps):
        env.step(np.repeat(action, env.num_envs, axis=0))


def hand_of(env: anysim.TaskEnv, number: int = 0) -> dict[str, Any]:
    assert env.families is not None
    facts: Any = env.families.facts(number)["it"]["pads"]
    return facts["hand"]


@EACH
def test_a_pinch_holds_with_its_force_feels_the_weight_and_loses_no_momentum(engine):
    """It slips by less than a millimetre in a second, and falls when the hand opens."""
    require_engine(engine)
    with begun(strip(engine=engine)) as (env, it):
        go(env, CLOSE, 28)
        forces = []
        for _ in range(15):
            go(env, CLOSE, 1)
            forces.append(it.body_force(ALL)[0, :, 2].sum())
        hand = hand_of(env)
        assert hand["stage"] == "holding"
        assert hand["force"] == pytest.approx(20.0, rel=0.05)
        assert hand["slip"] < 1e-3
        assert np.mean(forces) == pytest.approx(-it.mass(0) * 9.81, rel=0.1)
        fields = env.families.state("it").fields
        assert np.flatnonzero(fields["held"][0]).tolist() == sorted(hand["points"])
        assert np.array_equal(fields["held"], fields["pinched"])
        found = it.balance(ALL)
        lost = (found.now - found.begun - found.received + found.given)[0, :3]
        assert np.abs(lost).max() <= 1e-6 * np.abs(found.given).max()
        top = it.x[0, :, 2].max()
        go(env, OPEN, 25)  # fingers of some engines open slowly
        assert hand_of(env)["stage"] == "open"
        assert it.x[0, :, 2].max() < top - 0.015


def test_friction_decides_what_slips_out():
    """With a coefficient of 1 half the weight is the least force; half of that lets it fall, more of it holds."""
    fallen = {}
    for share in (0.5, 1.5):
        with begun(strip(force=share * 0.12 * 0.24 * 8.0 * 9.81 / 2)) as (env, it):
            go(env, CLOSE, 25)
            high = it.x[0, :, 2].max()
            go(env, CLOSE, 40)
            fallen[share] = high - it.x[0, :, 2].max()
    assert fallen[0.5] > 0.05
    assert fallen[1.5] < 0.005


def test_a_snapshot_of_pinched_cloth_goes_on_to_the_bit():
    with begun(strip({"areal_density": {"range": [4.0, 8.0]}}), num_envs=2) as (env, it):
        go(env, CLOSE, 30)
        assert [hand_of(env, number)["stage"] for number in (0, 1)] == ["holding"] * 2
        snapshot = env.snapshot()
        go(env, CLOSE, 8)
        expected = [it.x.copy(), it.pads.slip.copy(), it.pads.force.copy()]
        env.reset(seed=5)
        env.reset_to(snapshot)
        go(env, CLOSE, 8)
        found = [it.x, it.pads.slip, it.pads.force]
        assert all(np.array_equal(one, other) for one, other in zip(found, expected, strict=True))


def test_pads_that_close_on_nothing_are_empty():
    with begun(strip({"position": [0.8, 0.0, 0.14]})) as (env, _):
        go(env, CLOSE, 5)
        assert hand_of(env)["stage"] == "open"  # fingers of the engine have closed, pads have not
        go(env, CLOSE, 25)
        assert hand_of(env) == {"stage": "empty", "points": [], "force": 0.0, "slip": 0.0}


@pytest.mark.slow
@pytest.mark.parametrize("layers", [False, True])
def test_cloth_grasp_gathers_flat_cloth_and_lifts_it(layers):
    """A hand that comes from above with its fingers wide open: they gather a bulge, and press it."""
    cloth = {"kind": "garment", "towel": [0.24, 0.24], "spacing": 0.03, "position": [0.5, 0.0, 0.004], "friction": 0.4}
    cloth |= {"damping": 0.05, "drag": 1.5, "substeps": 2, "layers": layers, "pads": {"hand": PAD}}
    world = {"robots": {"panda": PANDA}, "terrain": {"kind": "plane", "friction": 0.4}}
    with begun(run_of(cloth, world=world)) as (env, it):
        grasp = ClothGrasp(env, robot=env.scene.robot("panda"), cloth=env.scene.category("it"), at=(0, 0), lift=0.1)
        grasp.begin(ALL)
        for _ in range(250):
            if grasp.outcome[0] != OUTCOMES.index(Outcome.RUNNING):
                break
            action = np.zeros((1, env.action_dim))
            grasp.act(ALL, action)
            env.step(action)
        hand = hand_of(env)
        assert grasp.outcome[0] == OUTCOMES.index(Outcome.OK)
        assert grasp.attempts[0] == 1
        assert hand["stage"] == "holding"
        assert hand["slip"] < 0.01
        assert it.x[0, :, 2].max() > 0.1


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"substeps": 1}, r"families\.it\.substeps.*0\.002 s at most.*substeps: 2"),
        ({"pads": {"hand": {**PAD, "joint": "panda.panda_joint1"}}}, r"pads\.hand\.joint.*does not slide.*sticky"),
        ({"pads": {"hand": {**PAD, "tool": "panda.panda_link5"}}}, r"pads\.hand\.joint.*does not slide"),
        ({"pads": {"hand": {**PAD, "size": [0.02, 0.0, 0.02]}}}, r"pads\.hand\.size"),
        ({"kind": "rope", "path": [[0, 0, 0], [0.2, 0, 0]]}, r"families\.it\.pads.*friction holds garments alone"),
    ],
)
def test_what_cannot_be_is_refused(change, words):
    made = {**STRIP, "pads": {"hand": PAD}, **change}
    if made["kind"] == "rope":
        made = {key: made[key] for key in ("kind", "path", "pads")}
    with pytest.raises(anysim.errors.AnysimError, match=words), begun(run_of(made, world={"robots": {"panda": PANDA}})):
        pass
