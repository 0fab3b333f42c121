"""Errors of a wrong world: all faults at once, each with its dotted key and the nearest name."""

from pathlib import Path
from typing import Any

import pytest

from anysim import registry
from anysim.assets.catalogue import CatalogueEntry, load_robot
from anysim.compile import robot
from anysim.compile.world import compile_world
from anysim.errors import AssetError, SpecError
from anysim.placement.order import placement_order
from anysim_schemas.layout import PlacementSpec
from anysim_schemas.robot_model import RobotModelSpec
from anysim_schemas.run import RunSpec, WorldSpec

CUBE = {"source": {"box": [0.04, 0.04, 0.04]}}


def complaints(**content: Any) -> list[str]:
    with pytest.raises(SpecError) as caught:
        compile_world(RunSpec.model_validate({"world": content}))
    return [str(issue) for issue in caught.value.issues]


def test_all_faults_come_at_once() -> None:
    found = complaints(
        robots={
            "panda": {
                "robot": "franka_panda",
                "home": {"panda_joint9": 0, "panda_joint4": 1},
                "actions": {"arn": "joint_position"},
            }
        },
        objects={"cube": {**CUBE, "color": "gren"}, "table": {**CUBE, "color": {"choice": ["red", "bleu"]}}},
        layout={"cub": {"position": [0, 0, 0]}, "cube": {"on": "tabel"}, "panda": {"position": [0, 0, 0]}},
        cameras={
            "a": {"from": [1, 1, 1], "look_at": "kube"},
            "b": {"mount": "panda.panda_hnd"},
            "c": {"mount": "pand.x"},
        },
        contact_sensors={"s": {"body": "panda.panda_leftfnger", "against": "tble"}, "t": {"body": "terrain"}},
        lights={"sun": {"direction": [0, 0, 0]}},
    )
    expected = [
        "world.robots.panda.home: the robot 'franka_panda' has no joint 'panda_joint9'; did you mean 'panda_joint7'?",
        "world.robots.panda.home.panda_joint4: 1 is outside of the joint's limits [-3.0718, -0.0698]",
        "world.robots.panda.actions.arn: the robot 'franka_panda' has no channel 'arn'; did you mean 'arm'?",
        "world.objects.cube.color: there is no colour 'gren'; did you mean 'green'?",
        "world.objects.table.color: there is no colour 'bleu'; did you mean 'blue'?",
        "world.layout.cub: there is no object 'cub'; did you mean 'cube'? (objects: cube, table)",
        "world.layout.cube.on: there is no object 'tabel' to rest on; did you mean 'table'?",
        "world.layout.panda: 'panda' is a robot; its place is in world.robots.panda (position, yaw)",
        "world.lights.sun.direction: a light needs a direction that is not zero",
        "world.cameras.a.look_at: there is no object 'kube' to look at; did you mean 'cube'?",
        "world.cameras.b.mount: 'panda' has no link or tool 'panda_hnd'; did you mean 'panda.panda_hand'?",
        "world.cameras.c.mount: there is no entity 'pand'; did you mean 'panda'?",
        "world.contact_sensors.s.body: 'panda' has no link or tool 'panda_leftfnger'; did you mean",
        "world.contact_sensors.s.against: there is no entity 'tble'; did you mean 'table'?",
        "world.contact_sensors.t.body: the ground has no contact sensor; sense the other body `against` it",
    ]  # fmt: skip
    assert len(found) == len(expected), "\n".join(found)
    for text, start in zip(found, expected, strict=True):
        assert text.startswith(start)


def test_an_unknown_robot_and_missing_assets() -> None:
    found = complaints(
        robots={"r": {"robot": "franka_pnda"}}, objects={"mug": {"source": "package:anysim_robots/mug.stl"}}
    )
    assert found[0].startswith(
        "world.robots.r.robot: no robot named 'franka_pnda' is installed; did you mean 'franka_panda'?"
    )
    assert found[1].startswith("world.objects.mug.source: asset 'package:anysim_robots/mug.stl' does not exist")


def test_assets_alone_are_an_asset_error(tmp_path: Path) -> None:
    (tmp_path / "cup.STL").write_text("x")
    spec = WorldSpec.model_validate({"objects": {"cup": {"source": "cup.stl"}, "pot": {"source": "pot.urdf"}}})
    with pytest.raises(AssetError) as caught:
        compile_world(spec, base=tmp_path)
    first, second = str(caught.value).splitlines()
    assert first.startswith("objects.cup.source: asset 'cup.stl' does not exist")
    assert "did you mean 'cup.STL'" in first
    assert second.startswith("objects.pot.source: asset 'pot.urdf' does not exist")


def test_circles_are_named_once() -> None:
    layout = {"a": {"on": "b"}, "b": {"on": "c"}, "c": {"on": "b"}, "d": {"on": "d"}}
    found = complaints(objects=dict.fromkeys("abcd", CUBE), layout=layout)
    assert found == [
        "world.layout.b.on: the objects rest on each other in a circle: b on c on b",
        "world.layout.d.on: the objects rest on each other in a circle: d on d",
    ]


def test_placement_order() -> None:
    on = lambda name: PlacementSpec(on=name)  # noqa: E731
    at = PlacementSpec(position=(0, 0, 0))
    assert placement_order({"a": on("b"), "x": at, "b": on("c"), "c": at}) == (["c", "b", "a", "x"], [])
    assert placement_order({"a": on("b"), "b": on("a"), "c": on("a"), "d": at}) == (["d"], [["a", "b"]])


def test_assets_that_do_not_suit(tmp_path: Path) -> None:
    (tmp_path / "a.urdf").write_text('<robot name="a"><link name="base"/></robot>')
    (tmp_path / "a.txt").write_text("x")
    for source, more, message in [
        ("a.urdf", {}, "objects.a.source: the root link 'base' of a free object has no mass"),
        ("a.urdf", {"density": 5}, "objects.a.density: an asset file has its own masses"),
        ("a.txt", {}, "'.txt' is no format of robots and assets (.urdf, .xml, .mjcf, .sdf, .usd, "),
    ]:
        spec = WorldSpec.model_validate({"objects": {"a": {"source": source, **more}}})
        with pytest.raises((SpecError, AssetError)) as caught:
            compile_world(spec, base=tmp_path)
        assert message in str(caught.value)


def test_camera_at_its_target() -> None:
    found = complaints(cameras={"a": {"from": [1, 1, 1], "look_at": [1, 1, 1]}})
    assert found == ["world.cameras.a.look_at: is where the camera is; move one of them"]


def test_a_wrong_catalogue_entry_names_its_file(monkeypatch: pytest.MonkeyPatch) -> None:
    good = load_robot("franka_panda")
    data = good.spec.to_dict()
    data["channels"]["eef"] |= {"joints": ["panda_finger_joint1", "panda_joint1"], "opened": [0.04]}
    data["channels"]["arm"]["joints"][6] = "panda_joint8"
    data["tools"] = {"tip": {"link": "panda_tip"}, "panda_hand": {"link": "panda_hand", "position": [0.0, 0.0, 0.1]}}
    data["surfaces"] = [{"links": ["*finger", "panda_fingre*"]}]
    data["home"]["panda_finger_joint2"] = 0.01
    bad = RobotModelSpec.model_validate(data)
    monkeypatch.setattr(robot, "load_robot", lambda name: CatalogueEntry(bad, good.file))
    found = complaints(robots={"r": {"robot": "franka_panda"}})
    starts = [
        "franka_panda.yaml: channels.arm.joints: the robot 'franka_panda' has no joint 'panda_joint8'",
        "franka_panda.yaml: home.panda_finger_joint2: 'panda_finger_joint2' follows 'panda_finger_joint1'",
        "franka_panda.yaml: surfaces.0.links: no link matches 'panda_fingre*'",
        "franka_panda.yaml: channels.eef.joints: 'panda_joint1' is driven by the channel 'arm' already",
        "franka_panda.yaml: channels.eef.opened: expected 2 values, one a joint, got 1",
        "franka_panda.yaml: tools.tip.link: there is no link 'panda_tip'",
        "franka_panda.yaml: tools.panda_hand: there is a link named 'panda_hand' already",
    ]
    assert len(found) == len(starts), "\n".join(found)
    for text, start in zip(found, starts, strict=True):
        assert text.startswith(start)


def test_a_room_needs_its_builder(monkeypatch: pytest.MonkeyPatch) -> None:
    installed = registry._entries
    monkeypatch.setattr(registry, "_entries", lambda kind: {} if kind == "rooms" else installed(kind))
    with pytest.raises(SpecError, match=r"anysim-assets: pip install anysim-assets") as caught:
        compile_world(WorldSpec.model_validate({"room": "kitchen"}))
    assert [issue.path for issue in caught.value.issues] == ["room"]
