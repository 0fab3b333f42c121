"""Tool motion of a Panda, made by a UR5 and by one arm of a robot that has two."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from anysim import compile_world
from anysim.errors import AnysimError
from anysim.kinematics.chain import Chain
from anysim.math import pose as P
from anysim.record.reader import open_trajectory
from anysim.testing.engines import require_engine
from anysim_planning.playing import FOLLOWED, play
from anysim_planning.retarget import Surroundings, arm_of, carried, retarget, tool_motion

ROOM = """
world:
  terrain: plane
  robots:
    panda: {robot: franka_panda, position: [0, 0, 0], actions: {arm: default}}
    other: {robot: ROBOT, position: [3, 1, 0], yaw: 0.7, actions: {arm: default}}
"""
CASES = [("ur5", "tool"), ("dual_ur5", "left"), ("dual_ur5", "right")]


MOUNTS = {"tool": None, "left": None, "right": np.array([0.0, -0.8, 0.0, 0.0, 0.0, 0.0, 1.0])}
"""Where an arm stands in its robot."""


def chains(folder: Path, robot: str, tool: str) -> tuple[Chain, Chain, np.ndarray, np.ndarray]:
    """The Panda and the other arm, and where their own bases are."""
    path = folder / "room.yaml"
    path.write_text(ROOM.replace("ROBOT", robot))
    world = compile_world(path)
    first, second = arm_of(world, "panda", "tool"), arm_of(world, "other", tool)
    assert len(second) == 6
    poses = world.initial_body_pose
    return first, second, poses[first.root], poses[second.root]


def motion(chain: Chain, base: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Three seconds of a Panda's tool: down, up and aside, turning."""
    times = np.linspace(0.0, 3.0, 151)
    swing = np.array([0.25, 0.15, 0.1, 0.2, 0.1, 0.15, 0.4])
    q = chain.initial + swing * np.sin(times[:, None] * np.linspace(1.0, 2.0, 7))
    return times, chain.tool_pose(np.tile(base, (len(times), 1)), q)


@pytest.mark.parametrize(("robot", "tool"), CASES)
def test_the_tool_goes_where_the_pandas_went(robot: str, tool: str, tmp_path: Path) -> None:
    panda, other, from_base, to_base = chains(tmp_path, robot, tool)
    times, poses = motion(panda, from_base)
    wanted = carried(poses, from_base, to_base, MOUNTS[tool])
    made = retarget(other, to_base, times, wanted, seed=3)
    assert made.reached.all(), made.position_error.max()
    there = other.tool_pose(np.tile(to_base, (len(times), 1)), made.joint_pos)
    assert np.linalg.norm(there[:, :3] - wanted[:, :3], axis=1).max() <= 1.5e-4
    assert P.angle_between(there[:, 3:], wanted[:, 3:]).max() <= 1.5e-3
    assert (made.joint_pos >= other.lower).all()
    assert (made.joint_pos <= other.upper).all()
    speed = np.abs(np.diff(made.joint_pos, axis=0)) / np.diff(made.times)[:, None]
    assert (speed <= other.velocity_limit * 1.000001).all()
    again = retarget(other, to_base, times, wanted, seed=3)
    np.testing.assert_array_equal(again.joint_pos, made.joint_pos)
    fast = retarget(other, to_base, times / 50, wanted, seed=3)
    assert fast.times[-1] > times[-1] / 50


@pytest.mark.parametrize(
    "engine", ["mujoco", *(pytest.param(name, marks=pytest.mark.slow) for name in ("pybullet", "sapien"))]
)
@pytest.mark.parametrize(("robot", "tool"), CASES[:2])
def test_played_by_its_drives_the_tool_stays_on_the_path(engine: str, robot: str, tool: str, tmp_path: Path) -> None:
    require_engine(engine)
    panda, other, from_base, to_base = chains(tmp_path, robot, tool)
    times, poses = motion(panda, from_base)
    wanted = carried(poses, from_base, to_base, MOUNTS[tool])
    made = retarget(other, to_base, times, wanted, seed=3)
    world = compile_world(tmp_path / "room.yaml")
    played = play(world, "other", tool, made.times, made.joint_pos, engine)
    assert played.times[-1] >= made.times[-1]
    assert np.ptp(played.tool_pose[:, :3], axis=0).max() > 0.1, "it has moved"
    there = other.tool_pose(np.tile(to_base, (len(played.times), 1)), played.joint_pos)
    np.testing.assert_allclose(played.tool_pose[:, :3], there[:, :3], atol=1e-4)
    position, rotation = played.strays(made.times, wanted)
    assert position <= FOLLOWED
    assert rotation <= 0.03
    late = played.strays(made.times + 0.5, wanted)  # what it would be against another motion
    assert late[0] > 3 * FOLLOWED


def test_what_is_out_of_reach_is_told_row_by_row(tmp_path: Path) -> None:
    panda, other, from_base, to_base = chains(tmp_path, *CASES[0])
    times, poses = motion(panda, from_base)
    away = carried(poses, from_base, to_base)
    away[75:, 2] += 3.0
    made = retarget(other, to_base, times, away)
    assert made.reached[:75].all()
    assert not made.reached[75:].any()
    assert (made.position_error[75:] > 1.0).all()
    with pytest.raises(AnysimError, match="rising times"):
        retarget(other, to_base, times[::-1], away)


def test_what_the_robot_touches_is_told_row_by_row(tmp_path: Path) -> None:
    """A pillar where the tool goes; a loose cube is not in its way."""
    panda, other, from_base, to_base = chains(tmp_path, "ur5", "tool")
    times, poses = motion(panda, from_base)
    wanted = carried(poses, from_base, to_base)
    place = [round(float(x), 3) for x in wanted[75, :3]]
    (tmp_path / "pillar.yaml").write_text(
        ROOM.replace("ROBOT", "ur5")
        + f"""
  objects:
    pillar: {{source: {{box: [0.04, 0.04, 0.04]}}, fixed: true}}
    cube: {{source: {{box: [0.04, 0.04, 0.04]}}}}
  layout:
    pillar: {{position: {place}, checked: false}}
    cube: {{position: {[*place[:2], 0.02]}, checked: false}}
"""
    )
    made = retarget(other, to_base, times, wanted, seed=3)
    assert made.free.all()  # nobody has looked
    for name, hit in (("room", False), ("pillar", True)):
        world = compile_world(tmp_path / f"{name}.yaml")
        around = Surroundings(world, other)
        made = retarget(other, to_base, times, wanted, seed=3, around=around)
        assert made.reached.all()
        assert (not made.free.all()) == hit
    assert not made.free[75]
    assert "pillar.shape" in around.touching(made.joint_pos[75])


def test_links_of_the_robot_may_not_touch_though_engines_let_them(tmp_path: Path) -> None:
    _, other, _, base = chains(tmp_path, "ur5", "tool")
    world = compile_world(tmp_path / "room.yaml")
    inwards = np.tile(base, (41, 1))
    inwards[:, :3] += np.array([[0.0, 0.0, 0.25]]) + np.linspace(0.45, 0.12, 41)[:, None] * [[0.8, 0.6, 0.0]]
    inwards[:, 3:] = np.array([0.1895, -0.1994, 0.9476, 0.1596]) / np.linalg.norm([0.1895, 0.1994, 0.9476, 0.1596])
    around = Surroundings(world, other)
    made = retarget(other, base, np.linspace(0.0, 2.0, 41), inwards, around=around)
    assert made.reached.all()
    assert made.free[:20].all()
    assert not made.free[-1]
    links = around.touching(made.joint_pos[-1])
    assert all(link.startswith("other.") for link in links), links


@pytest.mark.slow
def test_a_recording_of_a_panda_is_made_by_other_arms(tmp_path: Path) -> None:
    words = ["run", "pick_cube", "-k", "1", "-o", "record.cameras=[]", "--out", str(tmp_path / "out")]
    done = subprocess.run(
        [sys.executable, "-m", "anysim.cli", *words], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    (manifest,) = (tmp_path / "out").rglob("manifest.json")
    recording = open_trajectory(manifest.parent)
    words = ["retarget", str(manifest.parent), "-r", "dual_ur5", "--tool", "right", "--shift", "0", "-0.8", "0"]
    words += ["--play", "mujoco"]
    again = [sys.executable, "-m", "anysim.cli", *words, "--out", str(tmp_path / "made.npz"), "--json"]
    done = subprocess.run(again, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["played"]["engine"].startswith("mujoco ")
    assert found["played"]["position_error_m"] <= FOLLOWED
    assert found["reached"] == found["rows"] == recording.manifest.steps
    with np.load(tmp_path / "made.npz") as file:
        assert file["joint_pos"].shape == (found["rows"], 6)
        assert str(file["joints"][0]).rpartition(".")[2] == "right_shoulder_pan_joint"
    away = subprocess.run(
        [*again[:-3], "--shift", "9", "0", "0", "--json"], capture_output=True, text=True, check=False
    )
    assert away.returncode == 1
    assert json.loads(away.stdout)["reached"] == 0
    world = compile_world("pick_cube")
    done_by = tool_motion(recording, world, "panda", "tool")
    for robot, tool in CASES:
        _, other, _, base = chains(tmp_path, robot, tool)
        wanted = carried(done_by.poses, done_by.base, base, MOUNTS[tool])
        made = retarget(other, base, done_by.times, wanted)
        assert made.reached.all()
        assert made.position_error.max() <= 1e-4
        assert made.rotation_error.max() <= 1e-3
    with pytest.raises(AnysimError, match=r"there is no tool 'panda\.tol'"):
        tool_motion(recording, world, "panda", "tol")
