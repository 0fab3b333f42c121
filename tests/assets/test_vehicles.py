"""Vehicles in entries, checked against their models; bases made from parameters."""

from dataclasses import replace
from typing import Any

import pytest

from anysim.assets.catalogue import load_robot
from anysim.assets.procedural import build
from anysim.assets.vehicles import PLANAR_JOINTS, as_vehicle, planar
from anysim.compile.robot import import_robot
from anysim.compile.vehicle import check_vehicle
from anysim.errors import AssetError, Issues, SpecError
from anysim.model.world import BodyKind, JointType, Sphere
from anysim_schemas.robot_model import RobotModelSpec

BASES = ("differential_base", "ackermann_base", "holonomic_base")


def faults(robot: str, **changes: Any) -> str:
    """What is wrong with an entry whose vehicle differs."""
    entry = load_robot(robot)
    data = entry.spec.to_dict()
    vehicle = {**data["vehicle"], **changes}
    spec = RobotModelSpec.model_validate({**data, "vehicle": vehicle})
    issues = Issues()
    check_vehicle(spec, import_robot(entry), issues)
    try:
        issues.raise_if_any()
    except SpecError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("robot", BASES)
def test_the_catalogue_says_what_the_model_is(robot: str) -> None:
    assert faults(robot) == ""


@pytest.mark.parametrize(
    ("robot", "changes", "words"),
    [
        ("differential_base", {"left": "lefft_wheel"}, "no joint 'lefft_wheel'; did you mean 'left_wheel'?"),
        ("differential_base", {"left": "right_wheel"}, "one joint cannot be two parts"),
        ("differential_base", {"left": "right_wheel", "right": "left_wheel"}, "is on the right of"),
        ("differential_base", {"track": 0.4}, "are 0.42 m apart"),
        ("ackermann_base", {"wheelbase": 0.6}, "is 0.5 m before the rear axle"),
        ("ackermann_base", {"max_steering": 0.79}, "as the inner wheel it must by"),
        ("ackermann_base", {"rear_left": "front_left"}, "one channel must have all joints of the vehicle"),
        ("ackermann_base", {"front_left": "front_left"}, "give both of `front_left` and `front_right`"),
        ("ackermann_base", {"rear_left": "steer_left", "steering_left": "rear_left"}, "it must turn without end"),
    ],
)
def test_what_does_not_fit_is_said(robot: str, changes: dict[str, Any], words: str) -> None:
    assert words in faults(robot, **changes)


def test_a_module_elsewhere_is_said() -> None:
    vehicle = load_robot("holonomic_base").spec.to_dict()["vehicle"]
    vehicle["modules"][2]["position"] = [-0.3, 0.17]
    assert "is (-0.3, 0.17) m, but 'steer_rear_left' is at (-0.22, 0.17) m" in faults("holonomic_base", **vehicle)


@pytest.mark.parametrize("name", BASES)
def test_wheels_are_round_and_touch_at_one_height(name: str) -> None:
    model = build(name, {})
    tyres = [geom for geom in model.geoms if geom.name.endswith("tyre")]
    assert len(tyres) == {"differential_base": 2}.get(name, 4)
    entry = load_robot(name).spec
    assert {geom.shape for geom in tyres} == {Sphere(entry.base_height)}
    assert all(not geom.collides for geom in model.geoms if geom.name.endswith("rim"))


@pytest.mark.parametrize(
    ("name", "params", "words"),
    [
        ("differential_base", {"track": 0.3}, "reach into a body"),
        ("differential_base", {"castors": []}, "do not stand"),
        ("ackermann_base", {"wheelbase": 0.15}, "in each other"),
        ("holonomic_base", {"clearance": 0.1}, "reach into a body"),
        ("holonomic_base", {"size": [0.6, 0.5, -0.2]}, "greater than 0"),
    ],
)
def test_parts_that_do_not_fit_are_refused(name: str, params: dict[str, Any], words: str) -> None:
    with pytest.raises(SpecError, match=words):
        build(name, params)


def test_a_planar_base_is_put_under_a_robot() -> None:
    model = import_robot(load_robot("franka_panda"))
    moved = planar(model, "r")
    assert [joint.name for joint in moved.joints[:3]] == list(PLANAR_JOINTS)
    assert [joint.type for joint in moved.joints[:3]] == [JointType.PRISMATIC] * 2 + [JointType.REVOLUTE]
    assert all(joint.body == i + 1 for i, joint in enumerate(moved.joints))
    assert [body.kind for body in moved.bodies[:4]] == [BodyKind.STATIC] + [BodyKind.LINK] * 3
    assert len(moved.geoms) == len(model.geoms)
    for mine, theirs in zip(moved.joints[3:], model.joints, strict=True):
        assert mine.name == theirs.name
        assert (mine.mimic is None) == (theirs.mimic is None)
        if mine.mimic is not None and theirs.mimic is not None:
            assert moved.joints[mine.mimic.joint].name == model.joints[theirs.mimic.joint].name
    with pytest.raises(AssetError, match=r"has .* already; use the source"):
        planar(moved, "r")


def test_a_source_may_get_round_wheels() -> None:
    entry = load_robot("differential_base").spec
    assert entry.vehicle is not None
    rounded = entry.model_copy(update={"vehicle": entry.vehicle.model_copy(update={"rolling": "sphere"})})
    model = import_robot(load_robot("differential_base"))
    squared = replace(model, geoms=tuple(replace(g, visible=True) if "tyre" in g.name else g for g in model.geoms))
    found = as_vehicle(squared, rounded)
    touching = [g for g in found.geoms if g.body in (1, 2) and g.collides]
    assert [(g.shape, g.visible) for g in touching] == [(Sphere(0.1), False)] * 2
    assert len(found.geoms) == len(squared.geoms) + 2, "what was to be seen stays to be seen"
