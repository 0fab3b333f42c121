"""Live editing: adding and removing leaves everything else as it was, with all indices right."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from anysim.compile.edit import with_camera, with_object, with_robot, without_entity
from anysim.errors import AssetError, NameLookupError, SpecError
from anysim.model.index import Index
from anysim.model.world import BodyKind, World

Make = Callable[..., World]
CUBE = {"source": {"box": [0.04, 0.04, 0.04]}}


@pytest.fixture
def scene(world: Make) -> World:
    return world(
        objects={"cube": CUBE, "wall": {**CUBE, "fixed": True}},
        robots={"left": {"robot": "franka_panda"}, "right": {"robot": "franka_panda", "position": [0, 1, 0]}},
        cameras={
            "wrist": {"mount": "left.tool"},
            "other": {"mount": "right.tool"},
            "front": {"from": [1, 1, 1], "look_at": "cube"},
        },
        contact_sensors={
            "grip": {"body": "right.panda_leftfinger", "against": "cube"},
            "own": {"body": "left"},
            "any": {"body": "cube"},
        },
    )


def by_name(world: World) -> dict[str, Any]:
    """Everything of a world with indices replaced by names."""
    body = lambda i: "" if i < 0 else world.bodies[i].name  # noqa: E731
    joint = lambda i: world.joints[i].name  # noqa: E731
    return {
        "bodies": {b.name: (b.kind, body(b.parent), b.position, b.quaternion, b.inertial) for b in world.bodies},
        "joints": {j.name: (body(j.body), j.axis, j.mimic and joint(j.mimic.joint)) for j in world.joints},
        "geoms": {g.name: (body(g.body), g.shape, g.surface) for g in world.geoms},
        "sites": {s.name: (body(s.body), s.position) for s in world.sites},
        "drives": {a.name: (joint(a.joint), a.kp) for a in world.actuators},
        "cameras": {c.name: (body(c.body), c.position) for c in world.cameras},
        "sensors": {
            s.name: ([body(b) for b in s.bodies], s.against and [body(b) for b in s.against])
            for s in world.contact_sensors
        },
        "entities": {
            e.name: [*map(body, range(e.body_start, e.body_stop)), *map(joint, range(e.joint_start, e.joint_stop))]
            for e in world.entities
        },
        "robots": {
            r.name: {
                **{
                    n: ([joint(j) for j in c.joints], [world.actuators[a].name for a in c.actuators])
                    for n, c in r.channels.items()
                },
                **{n: world.sites[s].name for n, s in r.tools.items()},
            }
            for r in world.robots
        },
        "pairs": {(body(a), body(b)) for a, b in world.excluded_pairs},
    }


def test_adding_and_removing_an_object_is_the_identity(scene: World) -> None:
    more = with_object(scene, "ball", {"source": {"sphere": 0.1}, "mass": 0.5, "position": [1, 2, 3]})
    assert more.bodies[-1].position == (1, 2, 3)
    assert more.bodies[-1].inertial.mass == 0.5
    assert more.bodies[:-1] == scene.bodies
    assert Index(more).entity("ball").body_start == len(scene.bodies)
    assert without_entity(more, "ball").hash == scene.hash


def test_a_robot_may_stand_in_any_orientation(scene: World) -> None:
    turn = (0.5, 0.5, 0.5, 0.5)
    given = with_robot(scene, "wall_arm", "franka_panda", {"position": [0, 2, 1], "quaternion": turn})
    said = with_robot(scene, "wall_arm", "franka_panda", {"position": [0, 2, 1], "roll": np.pi / 2, "yaw": np.pi / 2})
    upright = with_robot(scene, "wall_arm", "franka_panda", {"position": [0, 2, 1]})
    for made in (given, said):
        root = made.bodies[made.entities[-1].body_start]
        assert root.position == (0, 2, 1)
        assert np.allclose(root.quaternion, turn)
        assert made.bodies[made.entities[-1].body_start + 1 :] == upright.bodies[upright.entities[-1].body_start + 1 :]
    with pytest.raises(SpecError, match=r"robots\.x\.quaternion: give either"):
        with_robot(scene, "x", "franka_panda", {"quaternion": turn, "yaw": 1.0})
    with pytest.raises(SpecError, match=r"robots\.x\.roll: expected a finite number"):
        with_robot(scene, "x", "franka_panda", {"roll": "flat"})


def test_adding_and_removing_a_robot_is_the_identity(scene: World) -> None:
    more = with_robot(scene, "third", "franka_panda", {"position": [0, 2, 0], "yaw": 0.5})
    assert [r.name for r in more.robots] == ["left", "right", "third"]
    arm = more.robots[2].channels["arm"]
    assert [more.joints[j].name for j in arm.joints] == [f"third.panda_joint{i}" for i in range(1, 8)]
    assert [more.actuators[a].joint for a in arm.actuators] == list(arm.joints)
    assert len(more.meshes) == len(scene.meshes)
    assert without_entity(more, "third").hash == scene.hash


def test_removing_from_the_middle_keeps_the_rest_by_name(scene: World) -> None:
    less = without_entity(scene, "left")
    before, after = by_name(scene), by_name(less)
    for kind in ("bodies", "joints", "geoms", "sites", "drives", "entities", "robots"):
        kept = {k: v for k, v in before[kind].items() if k != "left" and not k.startswith("left.")}
        assert after[kind] == kept, kind
    assert after["pairs"] == {p for p in before["pairs"] if not p[0].startswith("left.")}
    assert list(after["cameras"]) == ["other", "front"]  # the one that rode on it went with it
    assert after["cameras"]["other"] == before["cameras"]["other"]
    assert after["sensors"] == {k: before["sensors"][k] for k in ("grip", "any")}
    np.testing.assert_array_equal(less.initial_body_pose, scene.initial_body_pose[10:])
    for world in (less, scene):
        assert [world.body_joint[j.body] for j in world.joints] == list(range(len(world.joints)))


def test_removing_what_is_looked_at_and_felt(scene: World) -> None:
    less = without_entity(scene, "cube")
    front = next(c for c in less.cameras if c.name == "front")
    assert front.look_at is None
    assert front.position == (1, 1, 1)
    assert [s.name for s in less.contact_sensors] == ["own"]


def test_meshes_go_with_their_last_user(scene: World) -> None:
    assert without_entity(scene, "left").meshes == scene.meshes
    assert without_entity(without_entity(scene, "left"), "right").meshes == ()


def test_cameras_are_added_last(scene: World) -> None:
    more = with_camera(scene, "top", {"from": [0, 0, 3], "look_at": [0, 0, 0], "fov": 40})
    assert more.cameras[:-1] == scene.cameras
    assert more.cameras[-1].fov == 40


def test_orientations(world: Make) -> None:
    made = with_object(world(), "a", {**CUBE, "fixed": True, "yaw": np.pi / 2})
    made = with_object(made, "b", {**CUBE, "quaternion": [0, 0, 0.70710678, 0.70710678]})
    np.testing.assert_allclose(made.bodies[0].quaternion, made.bodies[1].quaternion, atol=1e-8)
    assert made.bodies[0].kind is BodyKind.STATIC


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ({**CUBE, "masss": 1}, "objects.new.masss: unknown key; did you mean 'mass'?"),
        ({**CUBE, "mass": -1}, "objects.new.mass"),
        ({**CUBE, "position": [1, 2]}, "objects.new.position: expected 3 finite numbers, got [1, 2]"),
        ({**CUBE, "yaw": "east"}, "objects.new.yaw: expected a finite number, got 'east'"),
        ({**CUBE, "yaw": 1, "quaternion": [0, 0, 0, 1]}, "give either a quaternion or roll, pitch and yaw"),
        ({**CUBE, "quaternion": [0, 0, 0, 2]}, "expected a unit quaternion"),
        ({**CUBE, "color": "rde"}, "objects.new.color: there is no colour 'rde'; did you mean 'red'?"),
        ({}, "objects.new.source"),
    ],
)
def test_wrong_objects(world: Make, spec: dict[str, Any], message: str) -> None:
    with pytest.raises(SpecError) as caught:
        with_object(world(), "new", spec)
    assert message in str(caught.value)


def test_wrong_names_and_references(scene: World) -> None:
    for name in ("cube", "left", "terrain"):
        with pytest.raises(SpecError, match=f"the name '{name}' is taken"):
            with_object(scene, name, CUBE)
        with pytest.raises(SpecError, match="is taken"):
            with_robot(scene, name, "franka_panda", {})
    with pytest.raises(SpecError, match="is no name"):
        with_object(scene, "a b", CUBE)
    with pytest.raises(SpecError, match="there is a camera named 'front' already"):
        with_camera(scene, "front", {"mount": "cube"})
    with pytest.raises(SpecError, match=r"cameras\.x\.mount: 'left' has no link or tool 'tol'; did you mean"):
        with_camera(scene, "x", {"mount": "left.tol"})
    with pytest.raises(SpecError, match=r"robots\.x\.robot: no robot named 'franka_pand' is installed; did you mean"):
        with_robot(scene, "x", "franka_pand", {})
    with pytest.raises(SpecError, match=r"robots\.x\.pos: unknown key"):
        with_robot(scene, "x", "franka_panda", {"pos": 1})
    with pytest.raises(NameLookupError, match="there is no entity 'cub'; did you mean 'cube'"):
        without_entity(scene, "cub")
    with pytest.raises(AssetError, match="needs the YAML file"):
        with_object(scene, "x", {"source": "cup.stl"})
