"""Banks as data: files, goal sets, versions; and counts that live between runs."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from anysim.errors import AssetError
from anysim.math import pose as P
from anysim.skills.bank import Bank, read_bank
from anysim.skills.living_bank import FLOOR, LivingBank


def bank() -> Bank:
    poses = np.array([[0.01 * i, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0] for i in range(4)])
    passed = {"mujoco 3": np.array([True] * 4), "sapien 3": np.array([True, False, True, False])}
    margin = np.array([3.0, 9.0, 1.5, 6.0])
    return Bank("thing", "body", "hand", "a", "g", poses, np.full(4, 0.04), ("box",) * 4, margin, passed, {"raw": 10})


def test_a_bank_reads_back_as_it_was_written(tmp_path: Path) -> None:
    one, path = bank(), tmp_path / "bank.json"
    path.write_text(json.dumps(one.document()))
    back = read_bank(path)
    assert back.document() == one.document()
    assert back.version == one.version
    assert replace(one, width=one.width + 1e-6).version != one.version
    assert replace(one, asset_hash="b").version != one.version


def test_goal_sets_are_in_the_world_and_ranked() -> None:
    one = bank()
    at = P.pose((1.0, 2.0, 3.0), (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)))
    goals = one.goal_set(at)
    np.testing.assert_allclose(goals[:, 1], 2.0 + 0.01 * np.array([1, 3, 0, 2]))
    np.testing.assert_allclose(one.goal_set(np.stack([at, at]), 2), np.stack([goals[:2]] * 2))
    assert one.ranked("sapien").tolist() == [0, 2]
    assert one.ranked("sapien 3", np.array([0.1, 1.0, 1.0, 1.0])).tolist() == [2, 0]
    with pytest.raises(AssetError, match=r"not tried on 'pybullet' \(on: mujoco 3, sapien 3\)"):
        one.goal_set(at, engine="pybullet")


def test_a_file_that_is_no_bank_is_refused(tmp_path: Path) -> None:
    with pytest.raises(AssetError, match=r"no bank at .*anysim bank build"):
        read_bank(tmp_path / "none.json")
    path = tmp_path / "bank.json"
    document = bank().document()
    for wrong in ("[]", "{", json.dumps(document | {"format": "x"}), json.dumps(document | {"candidates": [{}]})):
        path.write_text(wrong)
        with pytest.raises(AssetError, match=r"build it anew"):
            read_bank(path)


def test_counts_are_kept_between_runs_and_have_a_floor(tmp_path: Path) -> None:
    one = bank()
    first = LivingBank(one, "mujoco", tmp_path)
    assert first.belief.tolist() == [0.5] * 4
    empty = first.version
    for _ in range(40):
        first.note(1, success=False)
    first.note(2, success=True)
    assert first.belief.tolist() == [0.5] * 4, "not before the run is over"
    first.save()
    second = LivingBank(one, "mujoco", tmp_path)
    assert second.belief.tolist() == pytest.approx([0.5, FLOOR, 2 / 3, 0.5])
    assert one.ranked(belief=second.belief).tolist() == [3, 0, 2, 1]
    assert LivingBank(one, "sapien", tmp_path).belief.tolist() == [0.5] * 4
    assert second.version == first.version != empty


def test_two_runs_at_once_lose_no_outcome(tmp_path: Path) -> None:
    one = bank()
    runs = [LivingBank(one, "mujoco", tmp_path) for _ in range(3)]
    for run in runs:
        run.note(0, success=True)
    for run in runs:
        run.save()
        run.save()
    assert LivingBank(one, "mujoco", tmp_path).belief[0] == pytest.approx(4 / 5)


def test_pinned_counts_stay_as_they_are(tmp_path: Path) -> None:
    one = bank()
    run = LivingBank(one, "mujoco", tmp_path)
    run.note(0, success=True)
    run.save()
    pinned = LivingBank(one, "mujoco", tmp_path, pinned=run.version)
    pinned.note(0, success=False)
    pinned.save()
    assert LivingBank(one, "mujoco", tmp_path).version == run.version
    other = LivingBank(one, "mujoco", tmp_path)
    other.note(0, success=False)
    other.save()
    with pytest.raises(AssetError, match="outcomes were added since"):
        LivingBank(one, "mujoco", tmp_path, pinned=run.version)


def test_damaged_counts_are_refused(tmp_path: Path) -> None:
    run = LivingBank(bank(), "mujoco", tmp_path)
    for text in ("{", "[]", '{"format": "anysim-bank-counts-1", "counts": [[1, 2]]}'):
        run.path.write_text(text)
        with pytest.raises(AssetError, match="delete it to begin anew"):
            LivingBank(bank(), "mujoco", tmp_path)
