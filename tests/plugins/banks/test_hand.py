"""Grasps with the fingers of a hand: sampled across the thing, tried by closing them, each until it touches."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from anysim.api import compile_world
from anysim.engine.capability import Capability
from anysim.engine.factory import runnable
from anysim.errors import AssetError
from anysim.math import pose as P
from anysim.skills.bank import read_bank
from anysim_banks.cli import app
from anysim_banks.hand import Hand, hand
from anysim_banks.hand_grasps import HandGrasps
from anysim_banks.hand_trial import HandTrial
from anysim_banks.sampling import Candidates, tool_turn
from anysim_banks.subject import Subject, subjects

ENGINES = [e for e in ("mujoco", "pybullet", "sapien") if e in runnable(Capability.WRENCHES)]


@pytest.fixture(scope="module")
def allegro() -> Hand:
    return hand("xarm7_allegro")


def bottle(radius: float = 0.03) -> Subject:
    source = {"source": {"cylinder": [radius, 0.24]}, "mass": 0.2}
    return subjects(compile_world({"world": {"objects": {"bottle": source}}}), "bottle")[0]


def wraps(*places: tuple[float, float]) -> Candidates:
    """The palm beside the bottle's middle, whose axis is so far along the fingers and out of the palm [m]."""
    n = len(places)
    turn = tool_turn(np.tile([0.0, -1.0, 0.0], (n, 1)), np.tile([1.0, 0.0, 0.0], (n, 1)))
    offset = np.array([[0.0, y, z] for y, z in places])
    pose = np.concatenate([-P.rotate(turn, offset), turn], axis=1)
    return Candidates(pose, np.full(n, 0.06), np.full(n, "power"), np.zeros(n, dtype=int))


def test_it_is_the_hand_of_the_catalogue_without_its_arm(allegro: Hand) -> None:
    assert (len(allegro.model.bodies), len(allegro.actuators)) == (17, 16)
    assert set(allegro.synergies) == {"power", "pinch"}
    assert np.bincount(allegro.finger).tolist() == [4, 4, 4, 4]
    assert np.bincount(allegro.finger_of + 1).tolist() == [1, 4, 4, 4, 4]
    with pytest.raises(AssetError, match=r"'ur5' is neither a procedural gripper nor a robot .* fingers"):
        hand("ur5")


def test_the_palm_lies_across_the_thing(allegro: Hand) -> None:
    method = HandGrasps(bottle(), allegro)
    grasps = method.sampled(200, np.random.default_rng(2))
    assert (len(grasps.width), set(grasps.kind)) == (200, {"power", "pinch"})
    x, z = (P.rotate(grasps.pose[:, 3:], np.broadcast_to(np.eye(3)[k], (200, 3))) for k in (0, 2))
    np.testing.assert_allclose(np.abs(x[:, 2]), 1.0, atol=1e-9, err_msg="its x along the bottle")
    np.testing.assert_allclose(z[:, 2], 0.0, atol=1e-9)
    assert 0.1 < method.free(grasps).mean() < 0.95
    aside = z[:, 0] * grasps.pose[:, 1] - z[:, 1] * grasps.pose[:, 0]
    assert 0.03 < np.abs(aside).max() <= 0.04, "the axis passes the fingers"
    assert len(HandGrasps(bottle(0.06), allegro).sampled(10, np.random.default_rng(0)).width) == 0, "too thick"


@pytest.mark.parametrize("engine", [e if e == "mujoco" else pytest.param(e, marks=pytest.mark.slow) for e in ENGINES])
def test_fingers_around_a_bottle_hold_it_and_those_beside_it_do_not(allegro: Hand, engine: str) -> None:
    with HandTrial(allegro, bottle(), engine, envs=3) as trial:
        verdicts = trial.run(wraps((-0.014, -0.0135), (0.0, 0.15), (-0.014, -0.0135)))
    assert verdicts.margin[0] >= 2.0
    assert verdicts.margin[0] == verdicts.margin[2], "envs do not matter to one another"
    assert verdicts.margin[1] == 0.0
    assert verdicts.missed.tolist() == [False, True, False]


def test_a_bank_for_a_hand_is_built_and_goes_on_where_it_stopped(tmp_path: Path, allegro: Hand) -> None:
    line = ["build", "{cylinder: [0.03, 0.24]}", "-g", "xarm7_allegro", "--raw", "60", "--keep", "4"]
    line += ["--out", str(tmp_path), "--json"]
    result = CliRunner().invoke(app, line)
    assert result.exit_code == 0, result.output
    [row] = json.loads(result.stdout)["banks"]
    bank = read_bank(Path(row["file"]))
    assert (bank.gripper, len(bank), set(bank.kind) <= {"power", "pinch"}) == ("xarm7_allegro", 4, True)
    made = bank.provenance["hand"]
    assert isinstance(made, dict)
    assert (made["joints"], made["opened"]) == (list(allegro.joints), allegro.opened.tolist())
    [again] = json.loads(CliRunner().invoke(app, line).stdout)["banks"]
    assert (again["version"], again["raw_per_cpu_second"]) == (bank.version, 0.0)
