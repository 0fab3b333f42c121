"""Models of gymnasium against MuJoCo on the same files, with what docs/models.json is made of."""

from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from anysim.model.world import World
from tests.backends.mujoco.programs import gymnasium_files, program

pytestmark = pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass'")  # of MuJoCo on the cheetah's file


@pytest.fixture(scope="module")
def models() -> ModuleType:
    return program("models")


@pytest.fixture(scope="module")
def folder() -> Path:
    return gymnasium_files()


@pytest.mark.parametrize(
    ("file", "joints", "springs", "motion"),
    [("ant.xml", 8, 0, 1e-9), ("inverted_double_pendulum.xml", 3, 0, 1e-9), ("half_cheetah.xml", 9, 6, 1e-6)],
)
def test_they_weigh_and_move_as_in_mujoco(
    models: ModuleType, folder: Path, file: str, joints: int, springs: int, motion: float
) -> None:
    """100 steps under efforts, without contacts; a millionth is in the extra links of the cheetah's root."""
    (row,) = models.rows(folder / file, "gymnasium")
    assert (row.refused, row.joints, row.springs) == ("", joints, springs)
    assert max(row.mass, row.inertia, row.limits, row.passive) < 1e-10
    assert row.motion < motion


def test_springs_matter(models: ModuleType, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The comparison would find a model without them."""
    whole = models._world

    def without(*given: Any) -> World:
        world = whole(*given)
        return replace(world, joints=tuple(replace(joint, stiffness=0.0) for joint in world.joints))

    monkeypatch.setattr(models, "_world", without)
    (row,) = models.rows(folder / "half_cheetah.xml", "gymnasium")
    assert row.motion > 0.1
