"""Whole MJCF files in contact against MuJoCo on the same files, with what docs/model_contacts.json is made of."""

from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from anysim.model.world import World
from tests.backends.mujoco.programs import gymnasium_files, program

FAR = 1e-4


@pytest.fixture(scope="module")
def contacts() -> ModuleType:
    return program("model_contacts")


@pytest.fixture(scope="module")
def folder() -> Path:
    return gymnasium_files()


@pytest.mark.parametrize(
    ("file", "touching"), [("ant.xml", 5), ("humanoid.xml", 100), ("walker2d_v5.xml", 50), ("swimmer.xml", 0)]
)
def test_they_touch_and_move_as_in_mujoco(contacts: ModuleType, folder: Path, file: str, touching: int) -> None:
    """100 steps with contacts, limits and fluids, solved by the file's own integrator and solver."""
    row = contacts.compared(folder / file, "gymnasium", ("mujoco",))
    assert (row.refused, row.others) == ({}, {})
    assert row.touching >= touching
    assert row.mujoco is not None
    assert row.mujoco < FAR


@pytest.mark.parametrize("without", ["compliance", "parts"])
def test_what_the_file_sets_matters(
    contacts: ModuleType, folder: Path, monkeypatch: pytest.MonkeyPatch, without: str
) -> None:
    """The comparison would find a model without it."""
    whole = contacts.scene

    def less(*given: Any) -> tuple[World, list[int]]:
        world, roots = whole(*given)
        geoms = tuple(
            replace(g, part_com=None) if without == "parts" else replace(g, surface=replace(g.surface, compliance=None))
            for g in world.geoms
        )
        return replace(world, geoms=geoms), roots

    monkeypatch.setattr(contacts, "scene", less)
    row = contacts.compared(folder / "humanoid.xml", "gymnasium", ("mujoco",))
    assert row.mujoco is not None
    assert row.mujoco > FAR


def test_a_file_in_which_nothing_moves_has_a_reason(contacts: ModuleType, tmp_path: Path) -> None:
    path = tmp_path / "still.xml"
    path.write_text('<mujoco><worldbody><geom type="plane" size="1 1 1"/></worldbody></mujoco>')
    assert contacts.compared(path, "own", ("mujoco",)).refused == {"": "nothing in it moves"}
