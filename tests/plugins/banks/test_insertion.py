"""Insertions: the turns in which a thing fits come from its shape, and are tried with a peg that is pushed in."""

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
from anysim_banks.insertion import AHEAD, Insertions, insertions
from anysim_banks.insertion_trial import EASY, InsertionTrial
from anysim_banks.making import Order, made
from anysim_banks.sampling import Candidates

ENGINES = [e for e in ("mujoco", "pybullet", "sapien") if e in runnable(Capability.WRENCHES)]
CLEARANCE = 0.003


def of(peg: dict[str, object] | None = None, block: dict[str, object] | None = None) -> Insertions:
    sources = {"procedural": "peg", "params": peg or {}}, {"procedural": "hole_block", "params": block or {}}
    objects = {"peg": {"source": sources[0]}, "block": {"source": sources[1], "fixed": True}}
    [found] = insertions(compile_world({"world": {"objects": objects}}), "block")
    return found


def turned(method: Insertions, *degrees: float) -> Candidates:
    grid = method.sampled(360, np.random.default_rng(0))
    return grid.take(np.array(degrees, dtype=int))


def turns(candidates: Candidates) -> list[int]:
    """[degrees] of tips about the hole's axis."""
    tips = P.compose(candidates.pose, np.broadcast_to(AHEAD, candidates.pose.shape))
    return (np.round(np.degrees(2 * np.arctan2(tips[:, 5], tips[:, 6]))) % 360).astype(int).tolist()


@pytest.mark.parametrize(
    ("peg", "block", "fits"),
    [
        ({}, {}, [0, 90, 180, 270]),
        ({"along": "x"}, {}, [0, 90, 180, 270]),
        ({"section": "round"}, {"section": "round", "pieces": 24}, 16),
        ({"width": 0.05}, {}, []),
        ({"width": 0.01}, {}, 16),
    ],
)
def test_the_turns_in_which_it_fits_come_from_the_shapes(
    peg: dict[str, object], block: dict[str, object], fits: list[int] | int
) -> None:
    method = of(peg, block)
    grid = method.sampled(360, np.random.default_rng(0))
    assert turns(grid) == list(range(360))
    free = grid.take(np.flatnonzero(method.free(grid)))
    assert (turns(free) if isinstance(fits, list) else len(free.width)) == fits
    np.testing.assert_allclose(free.pose[:, :3], 0.0, atol=1e-12, err_msg="the end of the hole is the block's origin")


def test_a_plug_fits_in_both_ways_round_and_what_stands_beside_its_hole_is_in_the_way() -> None:
    world = compile_world("plug_charger")
    [method] = insertions(world, "socket")
    grid = method.sampled(360, np.random.default_rng(0))
    assert turns(grid.take(np.flatnonzero(method.free(grid)))) == [0, 180]
    assert method.subject.clearance == 0.0005


@pytest.mark.parametrize(
    "engine", [name if name == "mujoco" else pytest.param(name, marks=pytest.mark.slow) for name in ENGINES]
)
def test_a_peg_comes_to_its_end_unless_it_is_askew_or_lands_on_the_rim(engine: str) -> None:
    """Misplaced by up to the clearance it goes in, by more it stands on the rim."""
    method = of()
    with InsertionTrial(method.subject, method.tool, engine, envs=4) as trial:
        verdicts = trial.run(turned(method, 0, 45, 90, 180))
        assert verdicts.margin.tolist() == [1.0 / EASY, 0.0, 1.0 / EASY, 1.0 / EASY]
        assert verdicts.missed.tolist() == [False, True, False, False]
        assert trial.lasting(turned(method, 0, 45)).tolist() == [True, False]


@pytest.mark.slow
def test_verdicts_do_not_depend_on_order_and_number_of_envs() -> None:
    method = of({"section": "round", "width": 0.0345}, {"section": "round", "pieces": 12})
    some = turned(method, *range(0, 60, 6))
    with InsertionTrial(method.subject, method.tool, "mujoco", envs=4) as trial:
        there = trial.run(some).margin
    back = np.arange(10)[::-1]
    with InsertionTrial(method.subject, method.tool, "mujoco", envs=10) as trial:
        np.testing.assert_array_equal(trial.run(some.take(back)).margin[back], there)


@pytest.mark.slow
def test_a_bank_says_where_the_tip_comes_to() -> None:
    bank, rate = made(of(), "mujoco", Order(360, 8), print)
    assert rate > 0
    assert (len(bank), set(bank.kind), bank.gripper) == (4, {"insertion"}, "peg.tip")
    np.testing.assert_allclose(bank.approach, np.tile([0.0, 0.0, -1.0], (4, 1)), atol=1e-9)


def test_what_does_not_fit_says_so() -> None:
    with pytest.raises(AssetError, match=r"peg\.tip does not go into procedural:hole_block mouth: of 90 turns"):
        made(of({"width": 0.04}), "mujoco", Order(90, 8), print)


@pytest.mark.slow
def test_a_task_has_banks_of_its_holes_and_goes_on_where_it_stopped(tmp_path: Path) -> None:
    line = ["build", "peg_in_hole", "--raw", "90", "--keep", "6", "--out", str(tmp_path), "--json"]
    result = CliRunner().invoke(app, line)
    assert result.exit_code == 0, result.output
    rows = {row["affordance"]: row for row in json.loads(result.stdout)["banks"]}
    assert set(rows) == {"peg.body", "block.mouth"}
    bank = read_bank(Path(rows["block.mouth"]["file"]))
    assert (bank.affordance, len(bank), bank.provenance["depth"]) == ("mouth", 4, 0.05)
    more = CliRunner().invoke(app, [*line, "--object", "block", "-e", "mujoco,pybullet"])
    [again] = json.loads(more.stdout)["banks"]
    assert (again["kept"], again["raw_per_cpu_second"]) == (4, 0.0)
    assert again["passed"] == {name: 4 for name in again["passed"]}
    assert len(again["passed"]) == 2
