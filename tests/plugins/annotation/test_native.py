"""Segments, targets, points and trails of recorded episodes, against their states."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import anysim
from anysim.math import pose as P
from anysim.model.frames import find_frame
from anysim.record.names import trajectories
from anysim.record.reader import TrajectoryReader, open_trajectory
from anysim.skills.runner import SkillPolicy
from anysim_annotation import lens
from anysim_annotation.conformance import check_annotator
from anysim_annotation.files import read_records
from anysim_annotation.orders import read_orders
from anysim_annotation.render import AnnotationMaker
from anysim_annotation.segments import Intentions
from anysim_annotation.tools import placed
from anysim_film.stage import FilmOrder
from anysim_recording.collector import Collector

SIZE = (32, 24)
NAMES = "skeleton,eef_waypoint,obj_bbox,affordance,nav_point,camera"


def annotated(task: str, out: Path, camera: str, *overrides: str) -> tuple[TrajectoryReader, dict[str, list[dict]]]:
    """One solved episode, and its records by annotator."""
    with anysim.make(task, overrides=["record.cameras=[]", *overrides]) as env:
        list(Collector(env, SkillPolicy(env), out, 1, 0).run())
    [path] = trajectories(out)
    with AnnotationMaker(FilmOrder((camera,), size=SIZE), read_orders(NAMES), "geometry") as maker:
        where = maker.annotate(path).directory
    return open_trajectory(path), {n: read_records(where / f"{camera}.{n}.jsonl") for n in NAMES.split(",")}


@pytest.fixture(scope="module")
def pick(tmp_path_factory: pytest.TempPathFactory):
    return annotated("pick_cube", tmp_path_factory.mktemp("pick"), "front")


def poses(reader: TrajectoryReader, body: str, step: int) -> np.ndarray:
    rows = reader.initial_state if step == 0 else {"body_pose": reader.states["body_pose"][step - 1]}
    return rows["body_pose"][reader.manifest.layout.bodies.index(body)]


def test_each_skill_segment_has_the_box_that_its_target_had_when_it_began(pick) -> None:
    reader, said = pick
    grasp, bring = said["obj_bbox"]
    assert [r["skill"] for r in (grasp, bring)] == ["grasp", "bring"]
    assert (grasp["first_step"], bring["last_step"]) == (1, reader.manifest.steps)
    assert grasp["last_step"] + 1 == bring["first_step"]
    for box in (grasp, bring):
        assert (box["target"], box["name"]) == ("cube", "cube")
        assert np.abs(np.subtract(box["pose"], poses(reader, "cube", box["first_step"]))).max() < 1e-8
        assert np.abs(np.subtract(box["size"], 0.04)).max() < 1e-8


def test_an_affordance_is_on_the_target_where_the_tool_was_sent(pick) -> None:
    reader, said = pick
    phases = ["grasp: approach", "grasp: descend", "grasp: close", "bring: carry"]
    assert [r["phase"] for r in said["affordance"]] == phases
    [camera] = [r for r in said["camera"] if r["step"] == 0]
    for one in said["affordance"]:
        assert one["commanded"]
        assert one["hit"]
        assert np.abs(one["local"]).max() == pytest.approx(0.02, abs=1e-7)
        cube = poses(reader, "cube", one["last_step"])
        assert np.abs(cube[:3] + P.rotate(cube[3:], np.array(one["local"])) - one["point"]).max() < 1e-7
        seen = lens.project(np.array([[one["point"]]]), np.array([camera["pose"]]), np.array([camera["fov"]]), *SIZE)
        assert np.abs(seen.pixel[0, 0] - one["pixel"]).max() < 1e-6
    close = said["affordance"][2]
    assert close["normal"][2] > 0.99  # from above
    with anysim.make("pick_cube", overrides=["record.cameras=[]"]) as env:
        tool = find_frame(env.engine.world, "panda.tool")
        row = np.array(reader.states["body_pose"][close["last_step"] - 1])[None]
        reached = placed(tool, row)[0]
    assert np.linalg.norm(reached[:3] - close["tool_pose"][:3]) < 0.004
    assert P.angle_between(reached[3:], np.array(close["quaternion"])) < 0.02


def test_the_trail_is_where_the_tool_was(pick) -> None:
    _, said = pick
    rows = said["eef_waypoint"]
    assert len(rows[0]["trail"]) == 0
    assert len(rows[-1]["trail"]) == 16
    for before, now in pairwise(rows):
        assert np.abs(np.subtract(now["trail"][-1], before["pixel"])).max() < 1e-6  # this camera stands still
    assert {row["tool"] for row in rows} == {"panda.tool"}
    assert not said["nav_point"]


def test_a_skeleton_has_the_links_of_the_recording(pick) -> None:
    reader, said = pick
    row = said["skeleton"][-1]
    for link, parent, place in zip(row["links"], row["parents"], row["position"], strict=True):
        assert np.abs(poses(reader, link, row["step"])[:3] - place).max() < 1e-8
        assert parent < row["links"].index(link)
    assert row["links"][0] == "panda.panda_link0"
    assert all(row["inside"][i] == (0 <= p[0] <= 32 and 0 <= p[1] <= 24) for i, p in enumerate(row["pixels"]))


@pytest.mark.slow
def test_a_base_has_the_point_that_it_drove_to(tmp_path: Path) -> None:
    eye = "world.cameras.eye={from: [0, -0.1, 9], look_at: [0, 0, 0], size: [32, 24]}"
    reader, said = annotated("nav_to_pose", tmp_path / "run", "eye", eye)
    [point] = said["nav_point"]
    first, last = point["first_step"], point["last_step"]
    moved = [b for b in reader.manifest.layout.bodies if b.startswith("rover")]
    assert any(np.abs(poses(reader, b, last)[:2] - point["point"][:2]).max() < 1e-8 for b in moved)
    assert np.linalg.norm(np.subtract(point["point"], point["start"])) > 0.5
    assert point["point"][2] == 0.0
    assert (first, point["inside"]) == (1, True)
    assert not said["obj_bbox"]


def test_commands_say_what_they_are_for_with_what_was_drawn() -> None:
    bind = [
        "collect.bind={what: {choice: [cube, table]}}",
        "collect.commands=[{do: grasp, robot: panda, object: cube}, {choose: [{do: reach, robot: panda, goal: $what}, "
        "{do: push, robot: panda, object: $what, goal: goal}]}]",
    ]
    with anysim.make("pick_cube", num_envs=8, overrides=[*bind, "record.cameras=[]"]) as env:
        env.reset(seed=2)
        intentions = Intentions(env)
        assert intentions.params({"command": 1}, 0)["object"] == "cube"
        drawn = [intentions.params({"command": 3}, i)["object"] for i in range(8)]
        assert set(drawn) == {"cube", "table"}
        assert drawn == [env.bindings.said("$what", i) for i in range(8)]
        assert intentions.params({"command": 4}, 0) == {}
        assert intentions.params({}, 0) == {}


@pytest.mark.parametrize("name", ["eef_waypoint", "skeleton"])
def test_those_of_frames_keep_the_promises(name: str) -> None:
    check_annotator(name, world=one_arm())


def one_arm():
    """A robot, a box that moves, and a camera `eye`."""
    eye = "world.cameras={eye: {from: [1.5, 0.2, 1.0], look_at: [0.3, 0, 0.4], size: [32, 24], channels: []}}"
    world = anysim.compile_world("pick_cube", overrides=[eye, "record.cameras=[]"])
    return replace(world, cameras=tuple(camera for camera in world.cameras if camera.name == "eye"))
