"""Garments: their cut, how they bend, and hands that hold them."""

from typing import Any

import numpy as np
import pytest

import anysim
from anysim.testing.engines import require_engine
from anysim_soft.bending import bending_matrix, fastest
from anysim_soft.garment_cut import cut_of
from anysim_soft.garment_spec import GarmentSpec, ShirtSpec
from anysim_soft.subworld import ProxyMass, SubWorld
from tests.plugins.soft.softs import ALL, ENGINES, begun, run_of

EACH = pytest.mark.parametrize("engine", ["mujoco", *(pytest.param(e, marks=pytest.mark.slow) for e in ENGINES[1:])])
PAD = {"tool": "panda.tool", "joint": "panda.panda_finger_joint1", "closed": 0.008, "reach": 0.04}
PANDA = {"robot": "franka_panda", "actions": {"arm": "joint_delta_position", "eef": "gripper_binary"}}
CLOSE, OPEN = np.array([[0.0] * 7 + [-1.0]]), np.array([[0.0] * 7 + [1.0]])
OUTLINE = {"chest": 0.4, "length": 0.5, "sleeve": 0.1, "cuff": 0.15, "neck": [0.16, 0.05]}


def held(engine="mujoco", **pad):
    """A run with a towel that begins with the middle of an edge at the hand of a Panda, above the ground."""
    cloth = {"kind": "garment", "towel": [0.2, 0.2], "spacing": 0.04, "areal_density": {"range": [0.2, 0.4]}}
    cloth |= {"position": [0.5, 0.1, 0.3], "drag": 3.0, "pads": {"hand": {**PAD, **pad}}}
    return run_of(cloth, engine, {"robots": {"panda": PANDA}})


def go(env, action, steps):
    for _ in range(steps):
        env.step(np.repeat(action, env.num_envs, axis=0))


def hand_of(env, number=0):
    """What is said of the pad in an env."""
    facts: Any = env.families.facts(number)["it"]["pads"]
    return facts["hand"]


def test_cuts_have_the_areas_and_openings_that_they_are_asked_for():
    towel = cut_of(GarmentSpec(towel=(0.3, 0.2), spacing=0.04))
    assert towel.areas().sum() == pytest.approx(0.06)
    assert towel.shares().sum() == pytest.approx(0.06)
    one = cut_of(GarmentSpec(shirt=ShirtSpec(**OUTLINE, panels=1), spacing=0.05))
    two = cut_of(GarmentSpec(shirt=ShirtSpec(**OUTLINE), spacing=0.05))
    outline = 0.4 * 0.5 + 2 * 0.1 * 0.15 - 0.16 * 0.05
    assert one.areas().sum() == pytest.approx(outline)
    assert two.areas().sum() == pytest.approx(2 * outline)
    assert one.size == pytest.approx([0.6, 0.5])
    edges = np.sort(two.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    found, counts = np.unique(edges, axis=0, return_counts=True)
    assert counts.max() == 2  # a seam joins two triangles
    open_ends = found[counts == 1]
    length = np.linalg.norm(np.diff(two.points[open_ends], axis=1), axis=2).sum()
    cuff = 0.15
    assert length == pytest.approx(2 * (0.4 + 2 * cuff + 0.16 + 2 * 0.05))  # hem, cuffs and neck, of both pieces


def test_bending_is_that_of_a_sheet_along_its_threads_and_stiffer_across():
    cut = cut_of(GarmentSpec(towel=(0.3, 0.2), spacing=0.01))
    matrix, (x, y) = bending_matrix(cut.points, cut.hinges), cut.points.T
    assert np.abs(matrix.sum(axis=0)).max() < 1e-9 * np.abs(matrix).max()
    assert abs((3 * x + y) @ matrix @ (3 * x + y)) < 1e-6
    for along in (x, y):  # a cylinder of curvature 1
        assert (along**2 / 2) @ matrix @ (along**2 / 2) == pytest.approx(0.06, rel=0.06)
    across = ((x + y) ** 2 / 4) @ matrix @ ((x + y) ** 2 / 4)
    assert across == pytest.approx(1.5 * 0.06, rel=0.06)
    scaled = matrix / np.sqrt(np.outer(cut.shares(), cut.shares()))
    assert fastest(matrix, cut.shares()) == pytest.approx(np.linalg.eigvalsh(scaled)[-1], rel=0.01)


def test_a_strip_that_sticks_out_sinks_by_its_weight_over_its_rigidity():
    """Weak gravity: w L^4 / (8 D) to 15 %, of a length from the middle of its clamp; twice as stiff, half."""
    strip = {"kind": "garment", "towel": [0.2, 0.1], "spacing": 0.02, "areal_density": 0.2, "bending": 2e-4}
    strip["position"] = [0.0, 0.0, 1.0]
    drops = {}
    with begun(run_of(strip, dt=0.001, gravity=[0.0, 0.0, -0.2])) as (_, it):
        rows = np.unique(it.cut.points[:, 0].round(9))
        fixed, end = it.cut.points[:, 0] < rows[1] + 1e-6, it.cut.points[:, 0] > rows[-1] - 1e-6
        none = ProxyMass(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 6)))
        for rigidity in (2e-4, 4e-4):
            values = dict(zip(it.drawn_keys, it.values[0].tolist(), strict=True)) | {"bending": rigidity}
            source = it.source(values, it.frame[0])._replace(fixed=fixed)
            sub = SubWorld(source, it.scenery, none, (), 0.001, np.array([0.0, 0.0, -0.2]))
            sub.load(sub.beginning())
            for _ in range(1500):
                sub.step(1, 4.0)
            drops[rigidity] = 1.0 - sub.points()[end, 2].mean()
            formula = 0.2 * 0.2 * (0.2 - 0.5 * 0.02) ** 4 / (8 * rigidity)
            assert 1.0 < drops[rigidity] / formula < 1.2
    assert drops[2e-4] / drops[4e-4] == pytest.approx(2.0, rel=0.06)


@EACH
def test_a_hand_that_closes_holds_cloth_feels_its_weight_and_is_remembered(engine):
    """Nothing is lost between hand and cloth; a snapshot goes on with the same points; it falls when the hand opens."""
    require_engine(engine)  # `closed` is wide: cloth falls while fingers close, which takes longer on some engines
    with begun(held(engine, closed=0.025), num_envs=2) as (env, it):
        go(env, CLOSE, 40)
        one = hand_of(env, 1)
        assert one["stage"] == "holding"
        assert len(one["points"]) >= 1
        tool = env.scene.frame("panda.tool").position
        assert np.linalg.norm(it.x[1, one["points"]] - tool[1], axis=1).max() < 0.05
        found = it.balance(np.arange(2))
        lost = found.now - found.begun - found.received + found.given
        assert np.abs(lost[:, :3]).max() < 1e-9
        pulls = []
        for _ in range(60):
            go(env, CLOSE, 1)
            pulls.append(it.pads.force[:, 0].copy())
        weights = [it.mass(env_id) * 9.81 for env_id in (0, 1)]
        assert np.mean(pulls[-20:], axis=0) == pytest.approx(weights, rel=0.1)
        snapshot = env.snapshot()
        go(env, CLOSE, 3)
        expected = it.x.copy()
        env.reset(seed=5)
        env.reset_to(snapshot)
        go(env, CLOSE, 3)
        assert np.array_equal(it.x, expected)
        assert env.families.state("it").fields["held"].sum() == sum(len(hand_of(env, i)["points"]) for i in (0, 1))
        before = it.x[..., 2].max()
        go(env, OPEN, 60)
        assert not env.families.state("it").fields["held"].any()
        assert it.x[..., 2].max() < before - 0.1


def test_cloth_comes_off_where_it_pulls_too_hard_until_the_hand_has_opened():
    with begun(held(force=0.01)) as (env, it):
        go(env, CLOSE, 30)
        assert hand_of(env, 0)["stage"] == "empty"
        assert it.body_force(ALL)[..., :3].max() < 1e-9
        go(env, OPEN, 15)
        assert hand_of(env, 0)["stage"] == "open"


def test_it_begins_folded_as_it_is_asked_to():
    cloth = {"kind": "garment", "towel": [0.2, 0.2], "spacing": 0.02, "folded": {"range": [0.3, 0.45]}}
    with begun(run_of({**cloth, "position": [0.0, 0.0, 0.01]}), num_envs=2) as (env, it):
        first = it.x.copy()
        for env_id in (0, 1):
            share = it.parameter("folded", env_id)
            bend = it.garment.spacing
            assert first[env_id, :, 2].max() == pytest.approx(0.01 + 2 * bend)
            edge = first[env_id, it.cut.points[:, 0] > 0.1 - 1e-9, 0]
            assert edge == pytest.approx(0.1 - 2 * share * 0.2 + np.pi * bend)
        assert it.parameter("folded", 0) != it.parameter("folded", 1)
        for _ in range(10):
            env.step(np.zeros((2, 0)))
        assert np.isfinite(it.x).all()
        assert it.x[..., 2].max() < 0.06


def test_layers_lie_on_each_other_where_they_touch():
    """Twice the radius above, and what it weighs and how it moves as one is as before; without, in each other."""
    cloth = {"kind": "garment", "towel": [0.2, 0.1], "spacing": 0.025, "folded": 0.45, "position": [0.0, 0.0, 0.004]}
    highs = {}
    for layers in (False, True):
        with begun(run_of({**cloth, "damping": 0.05, "drag": 3.0, "layers": layers})) as (env, it):
            for _ in range(40):
                env.step(np.zeros((1, 0)))
            edge = it.cut.points[:, 0] > 0.1 - 1e-9
            highs[layers] = it.x[0, edge, 2].mean() - it.x[0, :, 2].min()
            found = it.balance(ALL)
            assert np.abs((found.now - found.begun - found.received)[0, :3]).max() < 1e-9
    assert highs[False] < 0.002
    assert 0.005 < highs[True] < 0.008


def test_it_begins_turned_in_its_plane_and_tilted():
    cloth = {"kind": "garment", "towel": [0.2, 0.1], "spacing": 0.05, "position": [0.0, 0.0, 0.3]}
    with begun(run_of({**cloth, "turned": np.pi / 2, "tilt": np.pi / 2})) as (_, it):
        assert np.ptp(it.x[0], axis=0) == pytest.approx([0.0, 0.2, 0.1], abs=1e-9)
        assert it.x[0, :, 2].min() == pytest.approx(0.3)
        assert it.x[0, np.argmin(it.cut.points[:, 1]), 2] == pytest.approx(0.4)


SHEET = {"kind": "garment", "towel": [0.1, 0.1]}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"shirt": {}}, r"families\.it\.towel.*give one of"),
        ({"towel": None}, r"families\.it\.towel.*give one of"),
        ({"spacing": 0.001}, r"families\.it\.spacing.*points"),
        ({"bending": 0.1}, r"families\.it\.bending.*too stiff.*substeps"),
        ({"folded": 0.9}, r"families\.it\.folded"),
        ({"layers": True, "pads": {"hand": PAD}}, r"families\.it\.layers.*pad 'hand' holds.*points: 1"),
        ({"young": 1e5}, r"families\.it\.young"),
        ({"towel": None, "shirt": {"neck": [0.5, 0.05]}}, r"shirt\.neck"),
        ({"pads": {"hand": {**PAD, "joint": "panda.none"}}}, r"pads\.hand.*panda\.none.*did you mean"),
        ({"pads": {"hand": {**PAD, "tool": "stand"}}}, r"pads\.hand\.tool.*neither moves"),
    ],
)
def test_what_cannot_be_is_refused(change, words):
    stand = {"objects": {"stand": {"source": {"box": [0.1, 0.1, 0.1]}, "fixed": True}}, "robots": {"panda": PANDA}}
    world = {**stand, "layout": {"stand": {"position": [0.5, 0.5, 0.05]}}} if "pads" in change else None
    with (
        pytest.raises(anysim.errors.AnysimError, match=words),
        anysim.make(run_of({**SHEET, **change}, world=world)) as e,
    ):
        e.reset(seed=0)


def test_stages_are_apart():
    """A pad that was empty takes hold only after it has opened: a closed hand that passes by picks nothing up."""
    with begun(held(reach=0.001)) as (env, _):
        stages = []
        for action in (CLOSE, OPEN, CLOSE):
            go(env, action, 12)
            stages.append(hand_of(env, 0)["stage"])
        assert stages == ["empty", "open", "empty"]
