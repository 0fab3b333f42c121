"""Containers, shelves and the surfaces of assets."""

from pathlib import Path

import numpy as np
import pytest

from anysim.errors import TaskError
from anysim.geometry.convex_parts import IDENTITY, Pose
from anysim.placement.context import PlacementContext
from tests.placement.helpers import Layouts

BALL = {"source": {"sphere": 0.02}}


def asset(folder: Path, name: str, boxes: list[tuple[list[float], list[float]]]) -> dict:
    """A URDF of boxes: sizes and centres."""
    parts = "".join(
        f'<{kind}><origin xyz="{" ".join(map(str, at))}"/><geometry><box size="{" ".join(map(str, size))}"/></geometry>'
        f"</{kind}>"
        for size, at in boxes
        for kind in ("collision", "visual")
    )
    inertia = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    path = folder / f"{name}.urdf"
    path.write_text(f'<robot name="{name}"><link name="body">{inertia}{parts}</link></robot>')
    return {"source": {"asset": str(path)}, "fixed": True}


@pytest.fixture
def bin_(tmp_path: Path) -> dict:
    """0.3 by 0.2 m, walls 0.01 m thick and 0.1 m high."""
    return asset(
        tmp_path,
        "bin",
        [
            ([0.3, 0.2, 0.01], [0, 0, 0.005]),
            ([0.01, 0.2, 0.1], [0.145, 0, 0.05]),
            ([0.01, 0.2, 0.1], [-0.145, 0, 0.05]),
            ([0.28, 0.01, 0.1], [0, 0.095, 0.05]),
            ([0.28, 0.01, 0.1], [0, -0.095, 0.05]),
        ],
    )


@pytest.fixture
def cabinet(tmp_path: Path) -> dict:
    """Open in front, with one board between bottom and top."""
    return asset(
        tmp_path,
        "cabinet",
        [
            ([0.3, 0.5, 0.02], [0, 0, 0.01]),
            ([0.28, 0.46, 0.02], [0, 0, 0.26]),
            ([0.3, 0.5, 0.02], [0, 0, 0.51]),
            ([0.3, 0.02, 0.5], [0, 0.24, 0.25]),
            ([0.3, 0.02, 0.5], [0, -0.24, 0.25]),
            ([0.02, 0.5, 0.5], [-0.14, 0, 0.25]),
        ],
    )


def test_in_a_bin_is_on_its_floor_between_its_walls(bin_: dict) -> None:
    things = {f"b{k}": BALL for k in range(12)}
    layouts = Layouts(
        {"bin": bin_, **things},
        {"bin": {"on": "table", "yaw": {"range": [-3, 3]}}, **{name: {"in": "bin"} for name in things}},
        4,
    )
    pose = layouts.reset()
    for env in range(4):
        gaps = layouts.gaps(pose, env)
        assert min(gaps.values()) > -1e-4
        for name in things:
            assert pose[name][env, 2] == pytest.approx(0.4 + 0.01 + 0.02)
            assert np.linalg.norm(pose[name][env, :2] - pose["bin"][env, :2]) < 0.18


def test_a_bin_that_is_full_is_an_error_in_bounded_time(bin_: dict) -> None:
    things = {f"b{k}": {"source": {"box": [0.09, 0.09, 0.05]}} for k in range(7)}
    layouts = Layouts({"bin": bin_, **things}, {"bin": {"on": "table"}, **{n: {"in": "bin"} for n in things}}, 1)
    with pytest.raises(TaskError, match=r"no place for 'b\d'.*of 'bin'"):
        layouts.reset()


def test_shelves_by_name(cabinet: dict) -> None:
    layouts = Layouts(
        {"cabinet": cabinet, "low": BALL, "high": BALL, "top": BALL, "somewhere": BALL},
        {
            "cabinet": {"on": "terrain", "x": 2.0},
            "low": {"on": "cabinet.shelf_1"},
            "high": {"on": "cabinet.shelf_2"},
            "top": {"on": "cabinet"},
            "somewhere": {"in": "cabinet"},
        },
        8,
    )
    pose = layouts.reset()
    assert np.allclose(pose["low"][:, 2], 0.02 + 0.02)
    assert np.allclose(pose["high"][:, 2], 0.27 + 0.02)
    assert np.allclose(pose["top"][:, 2], 0.52 + 0.02)
    assert set(np.round(pose["somewhere"][:, 2], 6)) == {0.04, 0.29}
    context = PlacementContext(layouts.world)
    found = context.surfaces_of(context.solid("cabinet").at(Pose((0.0, 0.0, 0.0), IDENTITY)))
    rooms = {s.name: s.headroom for s in found}
    assert rooms["shelf_1"] == pytest.approx(0.23)
    assert rooms["shelf_2"] == pytest.approx(0.23)


def test_what_is_too_high_for_a_shelf_does_not_fit(cabinet: dict) -> None:
    layouts = Layouts(
        {"cabinet": cabinet, "pole": {"source": {"box": [0.05, 0.05, 0.24]}}},
        {"cabinet": {"on": "terrain", "x": 2.0}, "pole": {"on": "cabinet.shelf_1"}},
        1,
    )
    with pytest.raises(TaskError, match=r"'pole'.*would be inside of 'cabinet'"):
        layouts.reset()
