"""MJCF import: what arrives is what MuJoCo itself makes of the file, and what cannot arrive is said."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from anysim.assets.model import ImportedModel
from anysim.compile.builder import WorldBuilder
from anysim.engine.base import SimEngine
from anysim.errors import AssetError
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import (
    Actuator,
    BodyKind,
    Box,
    ControlMode,
    EntityKind,
    HeightFieldShape,
    JointType,
    MeshShape,
    World,
)
from anysim_mujoco.mjcf.load import import_mjcf

ARM = """
<mujoco model="arm">
  <compiler angle="degree"/>
  <default><geom rgba="0.1 0.2 0.3 1" friction="0.7 0.01 0.001"/><joint damping="0.3" armature="0.02"/></default>
  <worldbody>
    <light pos="0 0 3"/><geom name="floor" type="plane" size="1 1 1"/>
    <body name="stand" pos="0 0 1" euler="0 0 30">
      <geom type="box" size="0.05 0.05 0.1"/>
      <body name="flange" pos="0.1 0 0" euler="0 20 0">
        <geom name="disc" type="cylinder" size="0.04 0.02" contype="0" conaffinity="0"/>
        <body name="upper" pos="0 0.1 0">
          <joint name="shoulder" axis="0 1 0" pos="0.02 0 0.01" range="-90 90" ref="10"/>
          <geom type="capsule" size="0.03 0.1" pos="0.1 0 0" euler="0 90 0"/>
          <body name="wrist" pos="0.25 0 0">
            <joint name="lift" type="slide" axis="0 0 1" range="-0.1 0.2"/>
            <joint name="turn" axis="1 0 0" damping="0.05" frictionloss="0.01"/>
            <geom type="sphere" size="0.04" contype="2" conaffinity="2"/>
            <site name="tip" pos="0.05 0 0"/>
            <body name="tool" pos="0.06 0 0"><geom type="box" size="0.02 0.01 0.01" mass="0.05"/></body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="p" joint="shoulder" kp="50" kv="5" forcerange="-20 20"/>
    <velocity name="v" joint="lift" kv="7"/>
    <motor name="m" joint="turn" gear="3" ctrlrange="-2 2"/>
    <general name="odd" joint="turn" biastype="affine" biasprm="1 -2 0" gainprm="5"/>
  </actuator>
</mujoco>
"""


@pytest.fixture
def load(tmp_path, monkeypatch) -> Callable[..., ImportedModel]:
    """`load(text, scale)`: the text as a file, imported; the cache is private."""
    monkeypatch.setenv("ANYSIM_CACHE_DIR", str(tmp_path / "cache"))

    def read(text: str, scale: float = 1.0) -> ImportedModel:
        path = tmp_path / "model.xml"
        path.write_text(text, encoding="utf-8")
        return import_mjcf(path, root=tmp_path, scale=scale)

    return read


def world_of(model: ImportedModel, height: float = 0.0) -> World:
    builder = WorldBuilder(World("imported"))
    builder.add("it", EntityKind.ROBOT, model, root=model.bodies[0].kind, position=(0.0, 0.0, height))
    return builder.build()


def words(model: ImportedModel) -> str:
    return "\n".join(str(note) for note in model.report)


def test_the_tree(load):
    """Depth first; rigid bodies are lumped and kept as sites, several joints become a chain."""
    model = load(ARM)
    assert [b.name for b in model.bodies] == ["stand", "upper", "wrist.lift", "wrist"]
    assert [b.kind for b in model.bodies] == [BodyKind.STATIC] + [BodyKind.LINK] * 3
    assert [b.parent for b in model.bodies] == [-1, 0, 1, 2]
    assert [(j.name, j.body, j.type) for j in model.joints] == [
        ("shoulder", 1, JointType.REVOLUTE),
        ("lift", 2, JointType.PRISMATIC),
        ("turn", 3, JointType.REVOLUTE),
    ]
    assert model.links == {"stand": 0, "flange": 0, "upper": 1, "wrist": 3, "tool": 3}
    assert {s.name: s.body for s in model.sites} == {"flange": 0, "tool": 3, "tip": 3}
    assert model.bodies[0].position == (0.0, 0.0, 0.0)
    assert "takes 1e-06 of its mass" in words(model)
    assert "1 geoms of the world" in words(model)


def test_joints(load):
    """Degrees, defaults, limits; positions keep the file's zero."""
    shoulder, lift, turn = load(ARM).joints
    assert shoulder.lower == pytest.approx(-np.pi / 2)
    assert (lift.lower, lift.upper) == (-0.1, 0.2)
    assert np.isinf(turn.upper)
    assert (shoulder.damping, shoulder.armature, turn.damping, turn.friction) == (0.3, 0.02, 0.05, 0.01)
    assert shoulder.anchor == (0.02, 0.0, 0.01)
    assert shoulder.initial == pytest.approx(np.radians(10))


def test_geoms(load):
    """Shapes, names, colours, friction; what collides is drawn where a link has nothing else to show."""
    model = load(ARM)
    geoms = {g.name: g for g in model.geoms}
    assert list(geoms) == ["stand.collision0", "disc", "upper.collision0", "wrist.collision0", "tool.collision0"]
    assert geoms["stand.collision0"].shape == Box((0.05, 0.05, 0.1))
    assert geoms["disc"].color == (0.1, 0.2, 0.3, 1.0)
    assert geoms["upper.collision0"].surface.friction == 0.7
    assert [g.collides for g in model.geoms] == [True, False, True, True, True]
    assert [g.visible for g in model.geoms] == [True] * 5
    assert model.geom_links == ("stand", "flange", "upper", "wrist", "tool")


def test_masks_that_never_meet_are_excluded_pairs(load):
    """The wrist's sphere meets nothing, but its tool has MuJoCo's usual masks; its own parent it never meets."""
    assert load(ARM).excluded_pairs == {(1, 3)}
    apart = ARM.replace(
        '<geom type="box" size="0.02 0.01 0.01" mass="0.05"/>', '<inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/>'
    )
    assert load(apart).excluded_pairs == {(0, 3), (1, 3)}


def test_drives(load):
    """Position, velocity and motor drives; another feedback is named."""
    model = load(ARM)
    p, v, m = model.actuator_hints
    assert (p.joint, p.mode, p.kp, p.kd, p.effort_limit) == (0, ControlMode.POSITION, 50.0, 5.0, 20.0)
    assert (v.joint, v.mode, v.kp, v.kd) == (1, ControlMode.VELOCITY, 0.0, 7.0)
    assert (m.joint, m.mode, m.effort_limit) == (2, ControlMode.EFFORT, 6.0)
    assert "actuator 'odd': has a feedback that is no position or velocity error (dropped)" in words(model)


def test_kinematics_are_mujocos_own(load):
    """Frames of all links at random positions, `ref` and anchors included."""
    model = load(ARM)
    world = world_of(model)
    raw = mujoco.MjModel.from_xml_string(ARM)
    data = mujoco.MjData(raw)
    base = np.array([0.0, 0.0, 1.0, 0.0, 0.0, np.sin(np.pi / 12), np.cos(np.pi / 12)])
    for q in np.random.default_rng(0).uniform(-0.1, 0.1, (5, 3)):
        data.qpos[:] = q
        mujoco.mj_kinematics(raw, data)
        roots = np.zeros((1, len(world.bodies), 7))
        roots[:, 0] = base
        poses = forward_kinematics(world, roots, q[None])[0]
        for name, body in model.links.items():
            site = next((s for s in model.sites if s.name == name), None)
            pose = poses[body] if site is None else P.compose(poses[body], np.array([*site.position, *site.quaternion]))
            assert np.allclose(pose[:3], data.body(name).xpos, atol=1e-9)
            wanted = data.body(name).xquat[[1, 2, 3, 0]]
            assert min(np.abs(pose[3:] - wanted).max(), np.abs(pose[3:] + wanted).max()) < 1e-9


def test_it_swings_like_the_file(load, make: Callable[..., SimEngine]):
    """One joint per body, so that no mass is added: the same motion through the neutral model as in MuJoCo."""
    text = ARM.replace('<joint name="lift" type="slide" axis="0 0 1" range="-0.1 0.2"/>', "")
    text = text.replace('<velocity name="v" joint="lift" kv="7"/>', "")
    world = world_of(load(text), height=2.0)
    engine = make(world)
    raw = mujoco.MjModel.from_xml_string(text.replace('pos="0 0 1" euler="0 0 30"', 'pos="0 0 2"'))
    raw.opt.integrator, raw.opt.timestep = mujoco.mjtIntegrator.mjINT_IMPLICITFAST, 0.002
    raw.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    raw.dof_solref[:], raw.dof_solimp[:] = [0.004, 1.0], [0.9999, 0.9999, 0.001, 0.5, 2.0]
    data = mujoco.MjData(raw)
    mujoco.mj_step(raw, data, nstep=300)
    engine.step(300)
    state = engine.get_state()
    assert np.abs(data.qvel).max() > 0.5
    assert np.allclose(state.joint_pos[0], data.qpos, atol=1e-4)
    assert np.allclose(state.joint_vel[0], data.qvel, atol=1e-3)


def test_a_free_body_and_masses(load):
    """A floating root; inertias from geoms, composed over lumped bodies."""
    text = """<mujoco><worldbody><body name="a" pos="1 2 3"><freejoint/><geom type="box" size=".1 .1 .1" mass="2"/>
      <body name="b" pos="0.3 0 0"><geom type="sphere" size=".1" mass="1"/></body></body></worldbody></mujoco>"""
    body = load(text).bodies[0]
    assert body.kind is BodyKind.FREE
    assert body.inertial.mass == pytest.approx(3.0)
    assert body.inertial.com == pytest.approx((0.1, 0.0, 0.0))
    yy = 2 * 0.02 / 3 + 0.4 * 0.01 + 2 * 0.1**2 + 1 * 0.2**2
    assert body.inertial.inertia[1] == pytest.approx(yy)


def test_scale(load):
    """Lengths, masses with the cube, inertias with the fifth power, slides' limits."""
    one, two = load(ARM), load(ARM, 2.0)
    assert two.bodies[1].inertial.mass == pytest.approx(8 * one.bodies[1].inertial.mass)
    assert two.bodies[1].inertial.inertia == pytest.approx([32 * v for v in one.bodies[1].inertial.inertia], abs=1e-12)
    assert two.joints[1].upper == pytest.approx(0.4)
    assert two.joints[0].upper == one.joints[0].upper
    assert two.geoms[0].shape == Box((0.1, 0.1, 0.2))
    assert np.allclose(two.bodies[3].position, 2 * np.array(one.bodies[3].position))


def test_a_root_that_turns_gets_a_base(load):
    """A pendulum hung from the world."""
    model = load("""<mujoco><worldbody><body name="bob" pos="0 0 2"><joint name="j" axis="0 1 0"/>
      <geom type="sphere" size=".1" pos="0 0 -1"/></body></worldbody></mujoco>""")
    assert [(b.name, b.kind) for b in model.bodies] == [("base", BodyKind.STATIC), ("bob", BodyKind.LINK)]
    assert model.bodies[1].position == (0.0, 0.0, 2.0)
    assert "gets a fixed base" in words(model)


def test_equalities_become_mimics(load):
    """Offset and slope, and a keyframe 'home' with the follower where it must be."""
    model = load("""<mujoco><worldbody><body name="b">
      <body name="l"><joint name="x" type="slide" axis="0 1 0" range="0 0.1"/><geom size=".1"/></body>
      <body name="r"><joint name="y" type="slide" axis="0 -1 0" range="0 0.5"/><geom size=".1"/></body></body>
      </worldbody>
      <equality><joint joint1="y" joint2="x" polycoef="0.01 2 0 0 0"/></equality>
      <keyframe><key name="home" qpos="0.05 0.3"/></keyframe></mujoco>""")
    assert model.joints[1].mimic == (0, 2.0, 0.01, ())
    assert [j.initial for j in model.joints] == pytest.approx([0.05, 0.11])


def test_meshes_and_height_fields(load, tmp_path, make: Callable[..., SimEngine]):
    """Hulls to collide, triangles to look at; fields with their relief (an XML's first row is the far one)."""
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "wedge.obj").write_text(
        "v 0 0 0\nv 0.2 0 0\nv 0 0.2 0\nv 0 0 0.2\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n", encoding="ascii"
    )
    model = load("""<mujoco><compiler meshdir="parts"/><asset><mesh name="w" file="wedge.obj" scale="2 2 2"/>
      <texture name="t" type="2d" file="missing.png"/><material name="m" texture="t" rgba="1 0 0 1"/>
      <hfield name="h" nrow="2" ncol="2" size="1 1 0.5 0.1" elevation="0 0 1 1"/></asset>
      <worldbody><body name="b"><geom name="look" type="mesh" mesh="w" material="m" contype="0" conaffinity="0"/>
        <geom name="touch" type="mesh" mesh="w"/><geom name="hill" type="hfield" hfield="h" pos="5 0 0"/>
        <geom name="egg" type="ellipsoid" size="0.1 0.2 0.3" pos="0 -5 0"/></body></worldbody></mujoco>""")
    look, touch, hill, egg = model.geoms
    assert look.color == (1.0, 0.0, 0.0, 1.0)
    assert (look.collides, look.visible, touch.collides, touch.visible) == (False, True, True, False)
    assert isinstance(touch.shape, MeshShape)
    assert isinstance(hill.shape, HeightFieldShape)
    assert isinstance(egg.shape, MeshShape)
    assert "ellipsoid" in words(model)
    engine = make(world_of(model))
    origins = np.array([[[0.1, 0.1, 3.0], [5.0, 0.999, 3.0], [5.0, -0.999, 3.0], [0.0, -5.0, 3.0]]])
    hits = engine.raycast(origins, np.broadcast_to([0.0, 0.0, -1.0], origins.shape))
    assert np.allclose(hits.distance, [[2.8, 3.0, 2.5, 2.7]], atol=2e-3)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            (
                '<joint name="turn" axis="1 0 0" damping="0.05" frictionloss="0.01"/>',
                '<joint name="turn" type="ball"/>',
            ),
            "turn of .* is a ball joint",
        ),
        (
            ("</worldbody>", '<body name="second"><geom size="1"/></body></worldbody>'),
            "exactly one body in its world; this one has stand, second",
        ),
        (("<geom", "<geon"), "MuJoCo cannot read it: .*geon"),
        (("</mujoco>", ""), "not well-formed XML"),
        (
            ('<compiler angle="degree"/>', '<include file="../secret.xml"/>'),
            "<include> of model.xml, line .* refers to '../secret.xml'",
        ),
        (('<compiler angle="degree"/>', '<include file="model.xml"/>'), "includes itself"),
        (
            ("<worldbody>", '<asset><mesh name="x" file="/etc/hostname"/></asset><worldbody>'),
            "mesh 'x' of model.xml refers to '/etc/hostname'",
        ),
        (
            ("<worldbody>", '<asset><mesh name="x" file="nil.stl"/></asset><worldbody>'),
            "mesh 'x' of model.xml refers to 'nil.stl', which does not exist",
        ),
    ],
)
def test_what_is_refused_and_how(load, tmp_path, change, words):
    """Each error names the file and the element."""
    (tmp_path.parent / "secret.xml").write_text("<mujoco/>", encoding="utf-8")
    with pytest.raises(AssetError, match=words):
        load(ARM.replace(change[0], change[1], 1))


def test_a_file_may_be_called_mjcf_and_have_parts(tmp_path):
    """MuJoCo itself reads .xml alone; meshes and parts lie where they would for it."""
    vertices = "0 0 0 1 0 0 0 1 0 0 0 1".split()
    faces = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
    (tmp_path / "shapes").mkdir()
    lines = [f"v {' '.join(vertices[3 * i : 3 * i + 3])}" for i in range(4)]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    (tmp_path / "shapes" / "corner.obj").write_text("\n".join(lines), encoding="utf-8")
    (tmp_path / "mesh.xml").write_text(
        '<mujoco><asset><mesh name="corner" file="shapes/corner.obj"/></asset></mujoco>', encoding="utf-8"
    )
    text = """<mujoco model="m"><include file="mesh.xml"/><worldbody><body name="b"><freejoint/>
        <geom type="mesh" mesh="corner"/></body></worldbody></mujoco>"""
    models = []
    for ending in ("mjcf", "xml"):
        (tmp_path / f"model.{ending}").write_text(text, encoding="utf-8")
        models.append(import_mjcf(tmp_path / f"model.{ending}", root=tmp_path))
    assert models[0].bodies == models[1].bodies
    assert [mesh.hash for mesh in models[0].meshes] == [mesh.hash for mesh in models[1].meshes]


def test_it_is_the_installed_importer(load, tmp_path):
    """A path that ends in .xml comes here, through the entry point."""
    from anysim.assets.load import import_asset

    load(ARM)
    assert [j.name for j in import_asset(f"file:{Path(tmp_path / 'model.xml')}").joints] == ["shoulder", "lift", "turn"]


def test_hints_can_drive_the_world(load, make: Callable[..., SimEngine]):
    """Imported, with its own drives: the position drive holds its target against gravity."""
    model = load(ARM)
    world = world_of(model, height=1.0)
    drives = tuple(
        Actuator(f"it.{i}", h.joint, h.mode, h.kp, h.kd, h.effort_limit) for i, h in enumerate(model.actuator_hints)
    )
    engine = make(replace(world, actuators=drives))
    engine.step(500)
    assert not engine.get_state().fault.any()
    assert abs(engine.get_state().joint_pos[0, 0] - world.joints[0].initial) < 0.2
