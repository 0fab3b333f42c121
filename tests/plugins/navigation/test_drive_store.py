"""Drives through rooms that are kept in a file: by base, engine and people, and what they come to."""

import json
from pathlib import Path

import pytest

from anysim.errors import AnysimError
from anysim_navigation_bench.drive_store import Cell, DriveStore, figures
from anysim_navigation_bench.drives import Drive

USUAL, SLOW = Cell("unitree_g1", "mujoco", 4), Cell("unitree_g1", "mujoco", 4, 0.4)
THERE, MET = Drive(1, "success", 40.0, 5.0, 3.0, 2.0), Drive(0, "person", 12.0, 4.5, 0.0, 2.0, "moving")


def test_drives_among_slower_people_are_kept_apart(tmp_path: Path) -> None:
    kept = DriveStore(tmp_path / "drives.json")
    kept.add(USUAL, MET)
    kept.add(SLOW, THERE)
    kept.add(SLOW, MET)
    read = DriveStore(tmp_path / "drives.json")
    assert (read.known(USUAL), read.known(SLOW)) == ([MET], [MET, THERE])
    found = figures(SLOW, read.known(SLOW))
    assert (found["pace"], found["rooms"], found["solved"], found["failed"]) == (0.4, 2, 1, {"0": "person"})
    assert found["time_over_shortest"] == 40.0 / (5.0 / 0.25)


def test_a_file_without_paces_has_the_usual_one(tmp_path: Path) -> None:
    line = {"robot": "unitree_g1", "engine": "mujoco", "people": 4, "drives": [MET]}
    (tmp_path / "drives.json").write_text(json.dumps([line]))
    assert DriveStore(tmp_path / "drives.json").known(USUAL) == [MET]


@pytest.mark.parametrize("text", ["{", "[1]", '[{"robot": "unitree_g1"}]', '[{"drives": 1}]'])
def test_another_file_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "drives.json").write_text(text)
    with pytest.raises(AnysimError, match=r"drives\.json is not a file of `anysim bench navigate --out`"):
        DriveStore(tmp_path / "drives.json")
