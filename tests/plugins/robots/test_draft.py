"""Drafts of catalogue entries: what is guessed, what is asked, and that each one builds."""

import re
from pathlib import Path

import numpy as np
import pytest

from anysim.api import compile_world, load
from anysim.assets.catalogue import load_robot
from anysim.assets.uri import example_robot_data
from anysim.conventions import Array
from anysim.errors import AssetError
from anysim.math import pose as P
from anysim.model.world import World
from anysim_robots.drafting.draft import draft
from anysim_robots.drafting.gains import BANDWIDTH, SAG, gains
from anysim_robots.qualify.stage import stage

ROOT = Path(__file__).parents[3]
ARM = ROOT / "tests" / "external" / "anysim-thirdarm" / "anysim_thirdarm" / "third_arm.urdf"

GUESSES = {  # file: category, legs, wheels, arm, eef, tool
    "panda_description/urdf/panda.urdf": ("arm", 0, 0, 7, 1, "panda_hand_tcp"),
    "go1_description/urdf/go1.urdf": ("quadruped", 4, 0, 0, 0, None),
    "g1_description/urdf/g1_29dof_rev_1_0.urdf": ("humanoid", 2, 0, 17, 0, "right_rubber_hand"),
    "allegro_hand_description/urdf/allegro_right_hand.urdf": ("hand", 0, 0, 0, 16, "palm_link"),
}


def built(made, folder: Path) -> World:
    target = folder / f"{made.name}.yaml"
    target.write_text(made.text(folder))
    return compile_world(load(stage(load_robot(str(target)))))


@pytest.mark.parametrize("file", GUESSES)
def test_known_robots_are_recognised_and_their_drafts_build(file: str, tmp_path: Path) -> None:
    made = draft(example_robot_data() / file)
    g = made.guess
    assert (g.category, len(g.legs), len(g.wheels), len(g.arm), len(g.eef), g.tool) == GUESSES[file]
    world = built(made, tmp_path)
    driven = sum(joint.mimic is None for joint in world.joints)
    assert (
        len(world.actuators) == driven == len(made.model.joints) - sum(j.mimic is not None for j in made.model.joints)
    )
    assert all(0 < a.effort_limit < np.inf for a in world.actuators)
    if g.floating:
        assert not load_robot(str(tmp_path / f"{made.name}.yaml")).spec.gravity_compensation
        assert 0.2 < g.base_height < 1.2


def test_gains_are_critically_damped_at_the_stated_bandwidth() -> None:
    made = draft(ARM)
    omega = 2 * np.pi * BANDWIDTH
    for name in ("turn", "shoulder", "elbow"):
        kp, kd, armature = made.gains[name]
        assert kd == pytest.approx(2 * kp / omega, rel=0.06)  # two digits
        assert armature == pytest.approx(kp / omega**2 / 11, rel=0.06)  # a tenth of the link's, of eleven tenths


def test_gains_bear_weight_that_nothing_compensates_and_move_what_follows(tmp_path: Path) -> None:
    """A rod held out by its end, and a follower of a follower on it that turns six times as far."""
    (tmp_path / "rod.xml").write_text("""<mujoco><worldbody><body name="b"><geom size=".1" mass="1"/>
      <body><joint name="lift" axis="0 1 0"/><inertial pos=".5 0 0" mass="1" diaginertia=".01 .01 .01"/>
      <body pos="1 0 0"><joint name="turn" axis="0 0 1"/><inertial pos="0 0 0" mass=".1" diaginertia=".1 .1 .1"/>
      <body><joint name="on" axis="0 0 1"/><inertial pos="0 0 0" mass=".1" diaginertia=".1 .1 .1"/></body></body></body>
      </body></worldbody><equality><joint joint1="turn" joint2="lift" polycoef="0 2 0 0 0"/>
      <joint joint1="on" joint2="turn" polycoef="0 3 0 0 0"/></equality></mujoco>""")
    model = draft(tmp_path / "rod.xml").model
    free, held = (gains(model, False, frozenset(), weighed)["lift"] for weighed in (False, True))
    omega = 2 * np.pi * BANDWIDTH
    about_y, about_z = 0.01 + 0.25 + 2 * (0.1 + 0.1), 2 * 2 * 0.2 + 6 * 6 * 0.1 + 2 * 2 * 6 * 0.1
    assert free.kp == pytest.approx(1.1 * (about_y + about_z) * omega**2, rel=0.06)
    weight = 9.81 * (0.5 + 0.2)
    assert held.kp == pytest.approx(max(weight / SAG, free.kp), rel=0.06)


def test_what_cannot_be_inferred_is_a_comment_of_the_file(tmp_path: Path) -> None:
    made = draft(ARM, "My Arm 2")
    text = made.text(tmp_path)
    assert made.name == "my_arm_2"
    assert re.search(r"^# TODO license: the SPDX", text, re.MULTILINE)
    assert "finger_mirror follow other joints and are in no channel" in text
    assert all(f"# TODO {words}" in text for words in made.open)
    spec = load_robot(_written(tmp_path / "x.yaml", text)).spec
    assert (spec.channels["eef"].opened, spec.channels["eef"].closed) == ((0.03,), (0.0,))
    assert spec.base == "fixed"


def _written(path: Path, text: str) -> str:
    path.write_text(text)
    return str(path)


def test_a_model_beside_the_draft_is_named_relative_to_it() -> None:
    assert "\nsource: third_arm.urdf\n" in draft(ARM).text(ARM.parent)


def test_a_floating_mjcf_with_wheels_is_a_base(tmp_path: Path) -> None:
    wheel = (
        '<body name="{0}" pos="{1} 0.2 0"><joint name="{0}_joint" axis="0 1 0"/>'
        '<geom type="cylinder" size="0.1 0.02" euler="90 0 0" mass="1"/></body>'
    )
    (tmp_path / "cart.xml").write_text(
        '<mujoco><worldbody><body name="cart" pos="0 0 0.1"><freejoint/>'
        '<geom type="box" size="0.3 0.15 0.05" mass="5"/>'
        + wheel.format("left_wheel", 0.2)
        + wheel.format("right_wheel", -0.2)
        + "</body></worldbody></mujoco>"
    )
    made = draft(tmp_path / "cart.xml")
    assert made.guess.category == "base"
    assert made.guess.wheels == ("left_wheel_joint", "right_wheel_joint")
    world = built(made, tmp_path)
    assert {str(actuator.mode) for actuator in world.actuators} == {"velocity"}
    assert made.guess.base_height == pytest.approx(0.1, abs=2e-3)


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(AssetError, match="takes a model file"):
        draft(tmp_path / "none.urdf")


def test_one_of_several_bodies_has_a_draft_of_its_own(tmp_path: Path) -> None:
    bodies = "".join(
        f'<body name="{side}"><body name="{side}_arm"><joint name="{side}_turn" axis="0 0 1"/>'
        '<geom type="box" size="0.1 0.1 0.1"/></body></body>'
        for side in ("left", "right")
    )
    (tmp_path / "pair.xml").write_text(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    made = draft(tmp_path / "pair.xml#right")
    assert made.name == "right"
    assert 'source: "pair.xml#right"' in made.text(tmp_path)
    assert [joint.name for joint in built(made, tmp_path).joints] == ["robot.right_turn"]


def test_drives_and_armature_of_the_file_are_the_drafts(tmp_path: Path) -> None:
    """A gripper of 20 N stays one of 20 N; what the file leaves open is guessed, and said to be."""
    (tmp_path / "grip.xml").write_text(
        """<mujoco><worldbody><body name="arm"><geom size="0.05" mass="1"/>
        <body name="upper" pos="0 0 0.1"><joint name="turn" axis="0 0 1" armature="0.1" range="-90 90"/>
          <geom type="box" size="0.02 0.02 0.2" mass="1"/>
          <body name="finger" pos="0 0 0.3"><joint name="grip" type="slide" axis="1 0 0" range="0 0.0412345678"/>
            <geom type="box" size="0.01 0.01 0.03" mass="0.05"/></body>
          <body name="free" pos="0 0 0.2"><joint name="loose" axis="1 0 0" range="10 90"/><geom size="0.01"/></body>
        </body></body></worldbody>
        <actuator><position joint="turn" kp="300" kv="30"/><position joint="grip" kp="700" kv="9" forcerange="-20 20"/>
        </actuator></mujoco>"""
    )
    made = draft(tmp_path / "grip.xml")
    text = made.text(tmp_path)
    assert "grip: {kp: 700, kd: 9, armature: " in text
    assert "turn: {kp: 300, kd: 30, effort_limit: " in text
    assert "}  # the file's: kp and kd, its effort limit" in text
    assert "}  # the file's: kp and kd, armature" in text
    world = built(made, tmp_path)
    drives = {a.name: a for a in world.actuators}
    assert (drives["robot.grip"].kp, drives["robot.grip"].effort_limit) == (700, 20)
    assert world.joints[0].armature == 0.1
    assert "effort limits: the source has none for turn, loose" in text


def test_positions_of_a_draft_are_inside_of_the_limits(tmp_path: Path) -> None:
    """A limit of 2 degrees has more decimals than a draft, and the joint begins there."""
    (tmp_path / "knee.xml").write_text(
        '<mujoco><worldbody><body name="b"><geom size="0.1"/><body name="l"><joint name="knee" range="-160 -2"/>'
        '<geom size="0.1"/></body><body name="f"><joint name="finger" range="0.00001 2.0001"/><geom size="0.1"/></body>'
        "</body></worldbody></mujoco>"
    )
    world = built(draft(tmp_path / "knee.xml"), tmp_path)
    assert [joint.initial for joint in world.joints] == [
        joint.upper if i == 0 else joint.lower for i, joint in enumerate(world.joints)
    ]


PLANAR = """<mujoco><worldbody><body name="torso" pos="0 0 0.6">
  <joint name="rootx" type="slide" axis="1 0 0"/><joint name="rootz" type="slide" axis="0 0 1"/>
  <joint name="rooty" axis="0 1 0"/><geom type="capsule" fromto="-.3 0 0 .3 0 0" size="0.05"/>
  {legs}</body></worldbody><actuator>{motors}</actuator></mujoco>"""


def test_a_planar_root_does_not_float(tmp_path: Path) -> None:
    """A cheetah: two legs, and three joints against the world that nothing drives."""
    leg = (
        '<body name="{0}thigh" pos="{1} 0 0"><joint name="{0}thigh_joint" axis="0 1 0" range="-30 30"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 -.25" size="0.03"/><body name="{0}foot" pos="0 0 -.25">'
        '<joint name="{0}foot_joint" axis="0 1 0" range="-30 30"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 -.25" size="0.03"/></body></body>'
    )
    motor = '<motor joint="{0}thigh_joint" gear="60"/><motor joint="{0}foot_joint" gear="30" ctrlrange="-1 1"/>'
    sides = (("front", 0.3), ("back", -0.3))
    (tmp_path / "cheetah.xml").write_text(
        PLANAR.format(
            legs="".join(leg.format(*side) for side in sides), motors="".join(motor.format(side[0]) for side in sides)
        )
    )
    made = draft(tmp_path / "cheetah.xml")
    assert not made.guess.floating
    assert made.guess.anchored == ("rootx", "rootz", "rooty")
    assert "base: fixed; its first body moves against the world by rootx, rootz, rooty" in made.guess.reasons
    world = built(made, tmp_path)
    assert [a.name for a in world.actuators] == [
        f"robot.{s}{j}_joint" for s in ("front", "back") for j in ("thigh", "foot")
    ]
    assert not any(body.gravity_compensation for body in world.bodies)


@pytest.mark.parametrize("chains", [4, 8])
def test_chains_at_the_corners_are_legs_and_not_fingers(tmp_path: Path, chains: int) -> None:
    """Whatever they are called, and stretched out flat as many files have them; those of a hand are on one side."""
    leg = (
        '<body pos="{0} {1} 0"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .2 0 0" size="0.02"/>'
        '<body pos="0.2 0 0"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .2 0 0" size="0.02"/>'
        "</body></body>"
    )
    places = [(x, y * (1 + 0.1 * k)) for x in (0.2, -0.2) for y in (0.1, -0.1) for k in range(chains // 4)]
    text = '<mujoco><worldbody><body name="b"><geom type="box" size="0.2 0.1 0.05"/>{0}</body></worldbody></mujoco>'
    (tmp_path / "dog.xml").write_text(text.format("".join(leg.format(*place) for place in places)))
    made = draft(tmp_path / "dog.xml")
    assert (made.guess.category, made.guess.floating, len(made.guess.legs)) == ("quadruped", True, chains)
    built(made, tmp_path)
    whole = text.format("".join(leg.format(*place) for place in places))
    (tmp_path / "ghost.xml").write_text(whole.replace("<geom", '<geom contype="0" conaffinity="0"'))
    ghost = draft(tmp_path / "ghost.xml").guess
    assert not ghost.floating
    assert "base: fixed; nothing of it collides, and without collision shapes it would fall for ever" in ghost.reasons
    sideways = "".join(leg.format(x, f"0 {y}").replace(' 0">', '">', 1) for x, y in places)
    (tmp_path / "side.xml").write_text(text.format(sideways))
    assert any("it lies on its side" in reason for reason in draft(tmp_path / "side.xml").guess.reasons)
    row = [(0.1, 0.03 * i) for i in range(3)] + [(-0.1, 0.0)]
    (tmp_path / "hand.xml").write_text(text.format("".join(leg.format(*place) for place in row)))
    assert draft(tmp_path / "hand.xml").guess.category == "hand"


def test_bent_legs_are_put_below_their_hips(tmp_path: Path) -> None:
    """Knees that cannot be straight leave the feet behind; the thighs bring them back, which is said."""
    leg = (
        '<body pos="{0} {1} 0"><joint name="hip{2}" axis="1 0 0" range="-40 40"/><inertial pos="0 0 0" mass=".2" '
        'diaginertia=".001 .001 .001"/><body><joint name="thigh{2}" axis="0 1 0" range="-60 200"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 -.2" size=".02"/><body name="calf{2}" pos="0 0 -.2">'
        '<joint name="knee{2}" axis="0 1 0" range="-150 -50"/><geom type="capsule" fromto="0 0 0 0 0 -.2" size=".02"/>'
        '<body name="foot{2}" pos="0 0 -.2"><geom size=".02"/></body></body></body></body>'
    )
    legs = "".join(leg.format(x, y, i) for i, (x, y) in enumerate((x, y) for x in (0.2, -0.2) for y in (0.1, -0.1)))
    box = '<geom type="box" size="0.2 0.1 0.05" mass="8"/>'
    (tmp_path / "dog.xml").write_text(f'<mujoco><worldbody><body name="b">{box}{legs}</body></worldbody></mujoco>')
    made = draft(tmp_path / "dog.xml")
    assert made.guess.reasons[-1] == "home: thigh0, thigh1, thigh2, thigh3 put the feet below them"
    assert "# Guessed: home: thigh0" in made.text(tmp_path)
    world = built(made, tmp_path)
    height = 0.2 * 2 * np.cos(np.radians(25))  # both of a length, the knee at -50 degrees
    assert made.guess.base_height == pytest.approx(height + 0.02, abs=2e-3)
    poses = dict(zip((body.name for body in world.bodies), world.initial_body_pose, strict=True))
    for i in range(4):
        calf = poses[f"robot.calf{i}"]
        foot = calf[:3] + P.rotate(calf[3:], np.array([0.0, 0.0, -0.2]))
        assert foot[:2] == pytest.approx(_thigh(world, poses, i)[:2], abs=0.01)


def _thigh(world: World, poses: dict[str, Array], i: int) -> Array:
    joint = next(j for j in world.joints if j.name == f"robot.thigh{i}")
    return poses[world.bodies[joint.body].name][:3]


@pytest.mark.parametrize(("fingers", "first"), [(2, "gripper_binary"), (5, "joint_position")])
def test_a_gripper_begins_at_an_end_and_a_hand_where_it_is(tmp_path: Path, fingers: int, first: str) -> None:
    """What is asked of neither then moves nothing: one command of a gripper opens it or closes it."""
    finger = (
        '<body pos="0 {0} .1"><joint name="finger{1}" type="slide" axis="0 1 0" range="-.01 .04"/>'
        '<geom size=".01"/></body>'
    )
    parts = "".join(finger.format(0.05 * i, i) for i in range(fingers))
    (tmp_path / "hand.xml").write_text(
        f'<mujoco><worldbody><body name="b"><geom size=".1"/>{parts}</body></worldbody></mujoco>'
    )
    made = draft(tmp_path / "hand.xml")
    world = built(made, tmp_path)
    assert next(iter(load_robot(str(tmp_path / "hand.yaml")).spec.channels["eef"].controllers)) == first
    assert {joint.initial for joint in world.joints} == ({-0.01} if fingers == 2 else {0.0})


@pytest.mark.parametrize(
    ("kind", "base", "channels"), [("planar", "fixed", {"base", "arm"}), ("floating", "floating", {"arm"})]
)
def test_roots_of_a_urdf_that_move(tmp_path: Path, kind: str, base: str, channels: set[str]) -> None:
    """A planar joint carries it, and its three are the channel of the base; a floating one is no joint at all."""
    part = (
        '<link name="{0}"><inertial><mass value="2"/><inertia ixx=".1" iyy=".1" izz=".1"/></inertial>'
        '<collision><geometry><box size=".4 .4 .2"/></geometry></collision></link>'
    )
    (tmp_path / "cart.urdf").write_text(
        f'<robot name="c"><link name="world"/>{part.format("body")}{part.format("arm")}'
        f'<joint name="move" type="{kind}"><parent link="world"/><child link="body"/><axis xyz="0 0 1"/></joint>'
        '<joint name="lift" type="revolute"><parent link="body"/><child link="arm"/><axis xyz="0 1 0"/>'
        '<limit lower="-1" upper="1" effort="20" velocity="2"/></joint></robot>'
    )
    made = draft(tmp_path / "cart.urdf")
    world = built(made, tmp_path)
    spec = load_robot(str(tmp_path / "cart.yaml")).spec
    assert (spec.base, set(spec.channels)) == (base, channels)
    assert len(world.actuators) == (4 if kind == "planar" else 1)
    if kind == "planar":
        assert spec.channels["base"].joints == ("move.x", "move.y", "move.yaw")
        told = "base: fixed; move.x, move.y, move.yaw between an empty root and its first body carry it"
        assert told in made.guess.reasons


def test_a_site_that_the_file_calls_tool_is_the_tool(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(
        """<mujoco model="arm"><worldbody><body name="upper"><joint name="shoulder" axis="0 1 0" range="-60 60"/>
        <geom size=".05 .2" type="capsule"/>
        <body name="hand" pos="0 0 .3"><joint name="wrist" axis="0 1 0" range="-60 60"/>
        <geom size=".05 .1" type="capsule"/><site name="tool" pos="0 0 .1"/></body></body></worldbody></mujoco>""",
        "utf-8",
    )
    world = built(draft(tmp_path / "arm.xml"), tmp_path)
    (robot,) = world.robots
    tool = world.sites[robot.tools["tool"]]
    assert [site.name for site in world.sites] == ["robot.tool"]
    assert (world.bodies[tool.body].name, tool.position) == ("robot.hand", (0.0, 0.0, 0.1))
