"""Reach of a robot: known distances, ways of joints, and base poses that are sampled or stated."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from anysim.api import compile_world
from anysim.errors import AssetError
from anysim.math import pose as P
from anysim_banks.cli import app
from anysim_banks.reach import Reach, parse_bases
from anysim_banks.subject import Subject, subjects
from anysim_skills.articulated.bar_grasps import bar_grasps

DOWN = [1.0, 0.0, 0.0, 0.0]


@pytest.fixture(scope="module")
def panda() -> Reach:
    return Reach("franka_panda")


def box() -> Subject:
    return subjects(compile_world({"world": {"objects": {"box": {"source": {"box": [0.04, 0.06, 0.1]}}}}}), "box")[0]


def cabinet(affordance: str) -> Subject:
    world = compile_world({"world": {"objects": {"cabinet": {"source": "procedural:cabinet"}}}})
    return subjects(world, "cabinet", affordance)[0]


def test_a_box_is_reached_from_half_a_metre_and_not_from_two() -> None:
    above = np.array([[0.0, 0.0, 0.02, *DOWN]])
    rng = np.random.default_rng(0)
    reached = Reach("franka_panda", [(-0.5, 0.0, -0.05, 0.0), (-2.0, 0.0, -0.05, 0.0)]).of(box(), above, rng)
    assert reached.grasps.tolist() == [[True], [False]]
    with pytest.raises(AssetError, match=r"franka_panda reaches none of 1 grasps .* from --base -2,0,0,0"):
        Reach("franka_panda", [(-2.0, 0.0, 0.0, 0.0)]).of(box(), above, rng)


def test_a_grasp_from_below_the_floor_of_a_base_is_reached_by_a_base_that_stands_lower(panda: Reach) -> None:
    from_below = np.array([[0.0, 0.0, -0.02, 0.0, 0.0, 0.0, 1.0]])
    bases = [(-0.5, 0.0, 0.6, 0.0), (-0.5, 0.0, -0.6, 0.0)]
    reached = Reach("franka_panda", bases).of(box(), from_below, np.random.default_rng(0))
    assert reached.grasps[:, 0].tolist() == [False, True]


def test_a_joint_moves_its_grasps_along_its_way() -> None:
    assert box().way.shape == (1, 7)
    drawer = cabinet("drawer_1.handle")
    moved = drawer.way[:, :3] - drawer.way[0, :3]
    assert drawer.pull is not None
    assert np.allclose(moved, np.linalg.norm(moved, axis=1)[:, None] * P.rotate(drawer.way[0, 3:], drawer.pull))
    assert np.linalg.norm(moved[-1]) > 0.1
    assert np.allclose(drawer.way[:, 3:], drawer.way[0, 3:])


def test_a_handle_is_not_reached_if_its_way_leads_too_close_to_the_robot() -> None:
    drawer = cabinet("drawer_1.handle")
    handle = P.compose(drawer.way[0], drawer.frame)
    grasps = P.compose(P.inverse(drawer.way[0]), bar_grasps(handle[None])[0])
    # the drawer opens along x by 0.26 m, towards a robot that looks at it
    close, well = ((handle[0] + distance, handle[1], handle[2] - 0.3, np.pi) for distance in (0.4, 0.8))
    reach, rng = Reach("franka_panda", [close, well]), np.random.default_rng(0)
    found, shut = reach.of(drawer, grasps, rng), reach.of(replace(drawer, way=drawer.way[:1]), grasps, rng)
    assert shut.grasps.any(axis=1).tolist() == [True, True]
    assert found.grasps.any(axis=1).tolist() == [False, True]


def test_sampled_bases_stand_beside_the_cabinet_on_its_floor_and_reach_its_handle(tmp_path: Path) -> None:
    line = ["build", "procedural:cabinet", "-a", "drawer_1.handle", "--robot", "mobile_panda"]
    result = CliRunner().invoke(app, [*line, "--raw", "60", "--keep", "4", "--out", str(tmp_path), "--json"])
    assert result.exit_code == 0, result.output
    [row] = json.loads(result.stdout)["banks"]
    assert (row["robot"], len(row["bases"])) == ("mobile_panda", len(row["reached"]))
    assert max(row["reached"]) <= row["free"]
    drawer = cabinet("drawer_1.handle")
    handle = P.compose(drawer.way[0], drawer.frame)
    for x, y, z, yaw in row["bases"]:
        distance = float(np.hypot(x - handle[0], y - handle[1]))
        assert 0.2 < distance < 2.0
        assert (handle[:2] - [x, y]) @ [np.cos(yaw), np.sin(yaw)] > 0.8 * distance, "it looks at the handle"
        assert z <= handle[2]
    again = CliRunner().invoke(app, [*line, "--raw", "60", "--keep", "4", "--out", str(tmp_path), "--json"])
    assert json.loads(again.stdout)["banks"][0]["raw_per_cpu_second"] == 0.0, "it was there already"


@pytest.mark.parametrize("word", ["1,2,3", "a,0,0,0", "nan,0,0,0"])
def test_bases_that_are_no_four_numbers_are_refused(word: str) -> None:
    with pytest.raises(AssetError, match="is not X,Y,Z,YAW"):
        parse_bases([word], "franka_panda")
    with pytest.raises(AssetError, match="add --robot"):
        parse_bases(["0,0,0,0"], "")
