"""URDF import: lumping, sanitising, and what is refused with which words."""

from collections.abc import Callable
from itertools import pairwise
from math import inf, pi
from pathlib import Path

import numpy as np
import pytest

from anysim.assets.catalogue import load_robot
from anysim.assets.model import ImportedModel
from anysim.compile.builder import WorldBuilder
from anysim.compile.robot import import_robot
from anysim.errors import AssetError
from anysim.kinematics import inertia
from anysim.model.world import BodyKind, Box, Cylinder, EntityKind, JointType, Sphere, World
from anysim_urdf.load import import_urdf

Load = Callable[..., ImportedModel]
Text = Callable[[float], str]


def link(name: str, content: str = "") -> str:
    return f'<link name="{name}">{content}</link>'


def joint(name: str, parent: str, child: str, kind: str = "revolute", content: str | None = None) -> str:
    inner = '<limit lower="-1" upper="1" effort="5" velocity="2"/>' if content is None else content
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inner}</joint>'


def notes(model: ImportedModel, kind: str) -> str:
    return "\n".join(str(note) for note in model.report if note.kind == kind)


def test_order_is_depth_first_with_children_in_source_order(urdf: Load, inertial: Text) -> None:
    names = ["base", "b", "c", "d", "e"]
    body = "".join(link(n, inertial(1)) for n in names)
    body += joint("j_e", "b", "e") + joint("j_b", "base", "b") + joint("j_c", "b", "c") + joint("j_d", "base", "d")
    model = urdf(body)
    assert [b.name for b in model.bodies] == ["base", "b", "e", "c", "d"]
    assert [j.name for j in model.joints] == ["j_b", "j_e", "j_c", "j_d"]
    assert [j.body for j in model.joints] == [1, 2, 3, 4]
    assert [b.parent for b in model.bodies] == [-1, 0, 1, 1, 0]
    assert [b.kind for b in model.bodies] == [BodyKind.STATIC] + [BodyKind.LINK] * 4


def test_fixed_joints_are_lumped_and_frames_kept(urdf: Load, inertial: Text) -> None:
    shift = '<origin xyz="0.5 0 0" rpy="0 0 1.5707963267948966"/>'
    ball = '<collision><origin xyz="0.1 0 0"/><geometry><sphere radius="0.02"/></geometry></collision>'
    model = urdf(
        link("base", inertial(1))
        + link("arm", inertial(2))
        + link("hand", inertial(3) + ball)
        + link("tip")
        + link("finger", inertial(0.1))
        + joint("j", "base", "arm")
        + joint("f", "arm", "hand", "fixed", shift)
        + joint("g", "hand", "tip", "fixed", shift)
        + joint("k", "tip", "finger", "prismatic", '<limit lower="0" upper="0.1" effort="1" velocity="1"/>')
    )
    assert [b.name for b in model.bodies] == ["base", "arm", "finger"]
    assert model.links == {"base": 0, "arm": 1, "hand": 1, "tip": 1, "finger": 2}
    sites = {s.name: s for s in model.sites}
    np.testing.assert_allclose(sites["hand"].position, (0.5, 0, 0), atol=1e-12)
    np.testing.assert_allclose(sites["tip"].position, (0.5, 0.5, 0), atol=1e-12)
    np.testing.assert_allclose(model.bodies[2].position, (0.5, 0.5, 0), atol=1e-12)
    np.testing.assert_allclose(model.geoms[0].position, (0.5, 0.1, 0), atol=1e-12)
    assert model.geom_links == ("hand",)
    arm = model.bodies[1].inertial
    assert arm.mass == pytest.approx(5)
    np.testing.assert_allclose(arm.com, (0.3, 0, 0), atol=1e-12)
    np.testing.assert_allclose(arm.inertia, (0.02, 0.02 + 2 * 0.09 + 3 * 0.04, 0.02 + 0.30, 0, 0, 0), atol=1e-12)


def test_geometry_and_colours(urdf: Load, inertial: Text) -> None:
    body = (
        '<material name="steel"><color rgba="0.1 0.2 0.3 1"/></material>'
        + link(
            "base",
            inertial(1)
            + '<visual><geometry><box size="0.2 0.4 0.6"/></geometry><material name="steel"/></visual>'
            + '<visual><geometry><cylinder radius="0.1" length="0.4"/></geometry></visual>'
            + '<collision><geometry><sphere radius="0.3"/></geometry></collision>',
        )
        + link("bare", inertial(1) + '<collision><geometry><sphere radius="0.1"/></geometry></collision>')
        + joint("j", "base", "bare")
    )
    box, cylinder, ball, bare = urdf(body).geoms
    assert (box.name, cylinder.name, ball.name) == ("base.visual0", "base.visual1", "base.collision0")
    assert box.shape == Box((0.1, 0.2, 0.3))
    assert cylinder.shape == Cylinder(0.1, 0.2)
    assert ball.shape == Sphere(0.3)
    assert box.color == (0.1, 0.2, 0.3, 1.0)
    assert (box.collides, box.visible, ball.collides, ball.visible) == (False, True, True, False)
    assert (bare.collides, bare.visible) == (True, True)  # nothing else shows this link


def test_joint_fields(urdf: Load, inertial: Text) -> None:
    content = '<axis xyz="0 3 4"/><limit lower="0.5" upper="2" effort="7" velocity="3"/>'
    content += '<dynamics damping="0.2" friction="0.1"/>'
    model = urdf(link("a", inertial(1)) + link("b", inertial(1)) + joint("j", "a", "b", content=content))
    (j,) = model.joints
    np.testing.assert_allclose(j.axis, (0, 0.6, 0.8))
    assert (j.lower, j.upper, j.effort_limit, j.velocity_limit) == (0.5, 2, 7, 3)
    assert (j.damping, j.friction, j.type) == (0.2, 0.1, JointType.REVOLUTE)
    assert j.initial == 0.5  # zero is outside of the limits
    assert "has an axis of length 5, now 1" in notes(model, "repaired")


@pytest.mark.parametrize(
    ("kind", "content", "kind_of_note", "text"),
    [
        ("continuous", "", "repaired", ""),
        ("revolute", "", "info", "has no limits and moves without end"),
        ("revolute", '<limit lower="1" upper="-1" effort="0" velocity="0"/>', "repaired", "has limits [1, -1]"),
        ("revolute", '<limit lower="0" upper="0" effort="1" velocity="1"/>', "repaired", "moving without end"),
        ("prismatic", '<limit effort="1" velocity="1"/>', "info", "has no limits"),
    ],
)
def test_joints_without_usable_limits(
    urdf: Load, inertial: Text, kind: str, content: str, kind_of_note: str, text: str
) -> None:
    model = urdf(link("a", inertial(1)) + link("b", inertial(1)) + joint("j", "a", "b", kind, content))
    (j,) = model.joints
    assert (j.lower, j.upper) == (-inf, inf)
    assert text in notes(model, kind_of_note)
    if 'effort="0"' in content:
        assert (j.effort_limit, j.velocity_limit) == (inf, inf)


def test_mimic_chains_follow_their_leader(urdf: Load, inertial: Text) -> None:
    wide = '<limit lower="0.2" upper="9" effort="1" velocity="1"/>'
    body = "".join(link(n, inertial(1)) for n in "abcd")
    body += joint("c", "a", "d", content=wide + '<mimic joint="b" multiplier="3" offset="1"/>')
    body += joint("b", "a", "c", content=wide + '<mimic joint="a" multiplier="2" offset="0.5"/>')
    body += joint("a", "a", "b", content=wide)
    model = urdf(body)
    first, second, leader = model.joints
    assert leader.mimic is None
    assert first.mimic == (2, 6.0, 2.5, ())
    assert second.mimic == (2, 2.0, 0.5, ())
    assert (leader.initial, second.initial) == (0.2, 0.9)
    assert first.initial == pytest.approx(3.7)


def test_impossible_inertias_are_repaired_and_reported(urdf: Load, inertial: Text) -> None:
    bad = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="4" ixy="0" ixz="0" iyz="0"/></inertial>'
    model = urdf(link("base", inertial(1)) + link("a", bad) + joint("j", "base", "a"))
    moments = np.linalg.eigvalsh(inertia.tensor(model.bodies[1].inertial))
    np.testing.assert_allclose(moments, (2, 2, 4), rtol=1e-5)
    assert moments[0] + moments[1] > moments[2]
    assert "link 'a' (arm.urdf:3): has an inertia that no body can have" in notes(model, "repaired")


def test_inertia_without_mass_is_dropped(urdf: Load, inertial: Text) -> None:
    """Some engines keep the inertia of a link that has no mass and some drop it: it is settled at the import."""
    nothing = '<inertial><mass value="0"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>'
    parts = link("base", inertial(1)) + link("hand", inertial(2)) + joint("j", "base", "hand")
    plain = urdf(parts)
    model = urdf(parts + link("grasp", nothing) + joint("f", "hand", "grasp", "fixed"))
    assert model.bodies[1].inertial == plain.bodies[1].inertial
    assert "has inertia and no mass; the inertia is dropped" in notes(model, "repaired")


def test_links_without_mass(urdf: Load, inertial: Text) -> None:
    ball = '<visual><geometry><sphere radius="0.3"/></geometry></visual>'
    limit = '<limit lower="0.3" upper="1" effort="1" velocity="1"/><axis xyz="1 0 0"/>'
    body = "".join(
        [
            link("base", inertial(1)),
            link("virtual"),
            link("arm", inertial(1)),
            link("leaf", ball),
            link("flap"),
            joint("j1", "base", "virtual"),
            joint("j2", "virtual", "arm"),
            joint("j3", "arm", "leaf", "prismatic", limit),
            joint("j4", "base", "flap", content=limit + '<mimic joint="j3"/>'),
        ]
    )
    model = urdf(body)
    assert [b.name for b in model.bodies] == ["base", "virtual", "arm"]
    assert model.bodies[1].inertial.mass == 0.001
    leaf = next(s for s in model.sites if s.name == "leaf")
    np.testing.assert_allclose(leaf.position, (0.3, 0, 0))  # the limit nearest to zero
    assert model.geoms[0].body == 2
    assert "link 'virtual' (arm.urdf:3): moves without mass; now 0.001 kg, 0.001 of what it carries" in notes(
        model, "repaired"
    )
    assert "moves no mass (link 'leaf'), so it is frozen" in notes(model, "dropped")


@pytest.mark.parametrize("mass", [1e-3, 70.0])
def test_links_without_mass_get_a_share_of_what_they_carry(urdf: Load, inertial: Text, mass: float) -> None:
    """Two in a row, x and y of a base: each has a thousandth of the base, not of each other."""
    place = '<limit lower="-1" upper="1" effort="1" velocity="1"/><origin xyz="0 0 0.5"/>'
    names = ["world", "x", "y", "base"]
    links = [link(name, inertial(mass) if name == "base" else "") for name in names]
    joints = [joint(b, a, b, "prismatic", place) for a, b in pairwise(names)]
    bodies = urdf("".join([*links, *joints])).bodies
    assert [b.inertial.mass for b in bodies] == pytest.approx([0, mass / 1000, mass / 1000, mass])
    assert bodies[1].inertial.com == pytest.approx((0.0, 0.0, 1.0))  # where the base is
    assert np.array(bodies[2].inertial.inertia) * 1000 == pytest.approx(bodies[3].inertial.inertia)


@pytest.mark.parametrize(("moment", "real"), [("4e-18", False), ("1e-12", False), ("1e-8", True), ("1e-6", True)])
def test_an_inertia_of_nothing_is_none(urdf: Load, inertial: Text, moment: str, real: bool) -> None:
    """4e-18 kg m^2 at 2.2 kg belong to a body of a few nanometres."""
    own = inertial(2.2).replace("0.01", moment)
    model = urdf(link("base", inertial(1)) + link("a", own) + joint("j", "base", "a"))
    if real:
        assert model.bodies[1].inertial.inertia[0] == float(moment)
        assert not model.report
    else:
        assert model.bodies[1].inertial.inertia[:3] == pytest.approx((0.4 * 2.2 * 1e-4,) * 3)
        assert "kg m^2, which is none; taken as a ball of 1 cm radius" in notes(model, "repaired")


def test_limits_that_are_far_out_are_none(urdf: Load, inertial: Text) -> None:
    """1e16 is what generators write for none, and engines each have a number of their own for that."""
    limit = '<limit lower="-1e16" upper="{0}" effort="1" velocity="1"/>'
    body = "".join(link(name, inertial(1)) for name in "abc")
    body += joint("j", "a", "b", content=limit.format("1e16")) + joint("k", "b", "c", content=limit.format("2"))
    model = urdf(body)
    assert "has limits [-1e+16, 1e+16], of which those beyond 1e+06 are none" in notes(model, "repaired")
    builder = WorldBuilder(World("w"))
    builder.add("it", EntityKind.OBJECT, model, root=BodyKind.STATIC)
    assert [(j.lower, j.upper) for j in builder.build().joints] == [(-inf, inf), (-inf, 2.0)]


def test_a_follower_of_a_frozen_joint_is_frozen(urdf: Load, inertial: Text) -> None:
    body = "".join(
        [
            link("base", inertial(1)),
            link("arm", inertial(1)),
            link("leaf"),
            link("hand", inertial(1)),
            joint("j1", "base", "arm"),
            joint("j2", "arm", "leaf"),
            joint("j3", "arm", "hand", content='<mimic joint="j2"/>'),
        ]
    )
    model = urdf(body)
    assert [j.name for j in model.joints] == ["j1"]
    assert model.bodies[1].inertial.mass == pytest.approx(2)
    assert "follows 'j2', which is frozen, so it is frozen too" in notes(model, "dropped")


def test_scale(urdf: Load, inertial: Text) -> None:
    ball = '<collision><origin xyz="0.1 0 0"/><geometry><sphere radius="0.3"/></geometry></collision>'
    limit = '<origin xyz="0 0 1"/><limit lower="0" upper="1" effort="1" velocity="1"/>'
    model = urdf(
        link("a", inertial(1) + ball) + link("b", inertial(1)) + joint("j", "a", "b", "prismatic", limit), scale=2.0
    )
    assert model.bodies[1].position == (0, 0, 2)
    assert model.bodies[1].inertial.mass == 8
    assert model.bodies[1].inertial.inertia[0] == pytest.approx(0.32)
    assert model.joints[0].upper == 2
    assert model.geoms[0].shape == Sphere(0.6)
    assert model.geoms[0].position == (0.2, 0, 0)


def test_visuals_without_collision_are_reported(urdf: Load, inertial: Text) -> None:
    ball = '<visual><geometry><sphere radius="0.3"/></geometry></visual>'
    model = urdf(link("a", inertial(1) + ball))
    assert "link 'a' (arm.urdf:3): has no collision geometry and touches nothing" in notes(model, "info")


def test_a_visual_that_cannot_be_read_is_dropped_and_reported(urdf: Load, inertial: Text, tmp_path: Path) -> None:
    (tmp_path / "a.wrl").write_text("x")
    model = urdf(link("a", inertial(1) + '<visual><geometry><mesh filename="a.wrl"/></geometry></visual>'))
    assert model.geoms == ()
    assert "is not fully shown" in notes(model, "dropped")


def test_looks_that_are_not_there_are_reported_and_what_collides_is_refused(urdf: Load, inertial: Text) -> None:
    visual = '<visual><geometry><mesh filename="{}"/></geometry></visual>'
    model = urdf(link("a", inertial(1) + visual.format("gone.stl") + BALL.format(1)))
    assert "link 'a' (arm.urdf:3): is not fully shown: 'gone.stl', which does not exist" in notes(model, "dropped")
    with pytest.raises(AssetError, match="there is no package 'nowhere'"):  # that has a remedy
        urdf(link("a", inertial(1) + visual.format("package://nowhere/gone.stl")))


def test_a_shape_of_no_size_is_reported(urdf: Load, inertial: Text) -> None:
    model = urdf(link("a", inertial(1) + BALL.format(0) + BALL.format(1)))
    assert [geom.shape for geom in model.geoms] == [Sphere(1.0)]
    assert "link 'a' (arm.urdf:3): has a <sphere> of size 0" in notes(model, "dropped")


A, B, C = link("a"), link("b"), link("c")
BALL = '<collision><geometry><sphere radius="{}"/></geometry></collision>'
PLANE = '<collision><geometry><plane normal="0 0 1"/></geometry></collision>'
MESH = '<collision><geometry><mesh filename="{}"/></geometry></collision>'
PART = '<inertial><mass value="1"/><inertia ixx="1"/></inertial>'
REFUSED = {
    "two roots": (A + B, "exactly one root link; this one has a, b"),
    "no links": ("", "has no links"),
    "loop": (A + B + joint("j", "a", "b") + joint("k", "b", "a"), "the joints form a loop"),
    "two parents": (A + B + C + joint("j", "a", "c") + joint("k", "b", "c"), "the link 'c' has two parents"),
    "apart": (A + B + C + joint("j", "b", "c") + joint("k", "c", "b"), "2 links form a loop apart from the root"),
    "unknown link": (A + joint("j", "a", "z"), "joint 'j' (arm.urdf:3) refers to the link 'z', which does not exist"),
    "type": (A + B + joint("j", "a", "b", "screw"), "(arm.urdf:3) is of type 'screw'; known are fixed, revolute"),
    "planar axis": (
        A + B + joint("j", "a", "b", "planar", '<axis xyz="0 0 0"/>'), "joint 'j' (arm.urdf:3) has an axis of length 0",
    ),
    "several follow": (
        A + B + joint("j", "a", "b", "spherical", '<mimic joint="k"/>'), "has several axes (spherical) and follows 'k'",
    ),
    "duplicate link": (A + A, "two links have the name 'a'"),
    "duplicate joint": (A + B + C + joint("j", "a", "b") + joint("j", "b", "c"), "two joints have the name 'j'"),
    "no mass": (A + B + joint("j", "a", "b"), "no link that moves has a mass"),
    "xacro": (link("a", MESH.format("$(optenv X a)/b.stl")), "arm.urdf:3: <mesh"),
    "xacro brace": (link("${prefix}a"), "name the .xacro file itself"),
    "plane": (link("a", PLANE), "link 'a' has a <plane>; a URDF knows box, sphere, cylinder, capsule, mesh"),
    "no size": (link("a", "<collision><geometry><box/></geometry></collision>"), "<box> of link 'a' lacks size"),
    "partial inertia": (link("a", PART), "<inertia> of link 'a' lacks iyy"),
    "negative size": (link("a", BALL.format(-1)), "<sphere> of link 'a' has the size [-1.0]"),
    "not a number": (link("a", BALL.format("big")), '<sphere radius="big"> of link \'a\': expected 1 finite number'),
    "not finite": (link("a", BALL.format("nan")), "expected 1 finite number"),
    "nameless": ('<link name=""/>', "arm.urdf:3: a <link> has no name"),
    "no child": (A + '<joint name="j" type="fixed"><parent link="a"/></joint>', "joint 'j' names no child link"),
    "missing mesh": (
        link("a", MESH.format("gone.stl")), "link 'a' (arm.urdf:3) refers to 'gone.stl', which does not exist",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_refused_with_file_and_element(urdf: Load, case: str) -> None:
    body, message = REFUSED[case]
    with pytest.raises(AssetError) as caught:
        urdf(body)
    assert message in str(caught.value)
    assert "arm.urdf" in str(caught.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ('<axis xyz="0 0 0"/>', "has an axis of length 0"),
        ('<mimic joint="x"/>', "follows 'x', which is no joint that moves"),
        ('<mimic joint="j"/>', "follows itself through 'j'"),
        ('<dynamics damping="much"/>', "of joint 'j': expected 1 finite number"),
    ],
)
def test_refused_joints(urdf: Load, inertial: Text, content: str, message: str) -> None:
    with pytest.raises(AssetError, match=r"arm\.urdf:3") as caught:
        urdf(link("a", inertial(1)) + link("b", inertial(1)) + joint("j", "a", "b", content=content))
    assert message in str(caught.value)


def test_entities_are_refused(tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_text("key")
    bomb = '<!DOCTYPE robot [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;">]>'
    for doctype in (bomb, f'<!DOCTYPE robot [<!ENTITY x SYSTEM "file://{secret}">]>'):
        path = tmp_path / "evil.urdf"
        path.write_text(f'{doctype}<robot name="a"><link name="a"/></robot>')
        with pytest.raises(AssetError, match="document type declaration"):
            import_urdf(path, root=tmp_path)


def test_damaged_files_are_named(tmp_path: Path) -> None:
    path = tmp_path / "a.urdf"
    for text, message in [("<robot", "not well-formed"), ("<sdf/>", "has the root element <robot>")]:
        path.write_text(text)
        with pytest.raises(AssetError, match=message):
            import_urdf(path, root=tmp_path)
    with pytest.raises(AssetError, match="cannot be read"):
        import_urdf(tmp_path / "none.urdf", root=tmp_path)


@pytest.mark.parametrize(
    "head",
    [
        '<?xml version="0.0"?>',
        "<?xml version='0.1' encoding='utf-8' ?>",
        '\n <?xml version="1.0"?>',
        '<!-- made by hand -->\n<?xml version="1.0"?>\n',
    ],
)
def test_odd_declarations_count_for_nothing(tmp_path: Path, inertial: Text, head: str) -> None:
    """26 files of pybullet_data say that they are XML 0.0."""
    (tmp_path / "arm.urdf").write_text(f'{head}<robot name="r">{link("a", inertial(1))}</robot>', encoding="utf-8")
    assert import_urdf(tmp_path / "arm.urdf", root=tmp_path).bodies[0].inertial.mass == 1


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("<deformable name='t'/>", "it is a deformable body of PyBullet"),
        ("<xacro:macro name='t' xmlns:xacro='http://www.ros.org/wiki/xacro'/>", "it is a xacro source"),
        ("<sensor name='s'/><gazebo/>", "it holds <sensor>, <gazebo>"),
    ],
)
def test_what_a_file_without_links_is(urdf: Load, body: str, words: str) -> None:
    with pytest.raises(AssetError, match=f"has no links: {words}"):
        urdf(body)


def test_trailing_null_bytes_and_deep_chains(tmp_path: Path, inertial: Text) -> None:
    count = 1500  # more than Python's recursion limit
    text = "".join(link(f"l{i}", inertial(0.01)) for i in range(count))
    text += "".join(joint(f"j{i}", f"l{i}", f"l{i + 1}") for i in range(count - 1))
    path = tmp_path / "deep.urdf"
    path.write_text(f'<robot name="a">{text}</robot>\0')
    model = import_urdf(path, root=tmp_path)
    assert len(model.bodies) == count
    assert model.joints[-1].body == count - 1
    assert pi > model.joints[0].upper


def test_a_follower_has_room_to_follow() -> None:
    """PR2's grippers: a follower's own limits would lock its leader at 0."""
    robot = import_robot(load_robot("pr2"))
    joints = {joint.name: joint for joint in robot.joints}
    follower, leader = joints["l_gripper_r_parallel_root_joint"], joints["l_gripper_l_finger_joint"]
    assert follower.lower == pytest.approx(-leader.upper)
    assert any(note.kind == "repaired" and "now as far as that" in note.message for note in robot.report)
