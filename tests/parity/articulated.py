"""Worlds with articulated objects, and answers worked out by hand for what happens in them."""

from pathlib import Path
from typing import Any

import numpy as np

from anysim.compile.world import compile_world
from anysim.conventions import Array
from anysim.kinematics.dynamics import frame_jacobians
from anysim.math import pose as P
from anysim.model.world import Inertial, Joint, World
from anysim_schemas.engine import PhysicsSpec
from anysim_schemas.run import WorldSpec

DT = 0.002

CABINET: dict[str, Any] = {
    "source": {
        "procedural": "cabinet",
        "params": {
            "size": [0.45, 1.3, 0.7],
            "columns": [["drawer", "drawer", "drawer"], ["door", "open"], ["double_door", "drawer"]],
            "widths": [1.0, 1.0, 1.5],
        },
    },
    "fixed": True,
}

URDF = """<robot name="trolley">
  <link name="frame">
    <inertial><mass value="4"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="0.4 0.3 0.1"/></geometry></collision>
  </link>
  <link name="tray">
    <inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="0.2 0.2 0.02"/></geometry></collision>
  </link>
  <link name="flap">
    <inertial><origin xyz="0.1 0 0"/><mass value="0.5"/>
      <inertia ixx="0.002" iyy="0.004" izz="0.004" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0.1 0 0"/><geometry><box size="0.18 0.2 0.01"/></geometry></collision>
  </link>
  <link name="dial">
    <inertial><mass value="0.2"/><inertia ixx="0.0005" iyy="0.0005" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><cylinder radius="0.05" length="0.02"/></geometry></collision>
  </link>
  <link name="mark"/>
  <joint name="slide" type="prismatic"><parent link="frame"/><child link="tray"/><origin xyz="0 0 0.1"/>
    <axis xyz="1 0 0"/><limit lower="-0.16" upper="0" effort="10" velocity="1"/><dynamics damping="1.5" friction="0.8"/>
  </joint>
  <joint name="hinge" type="revolute"><parent link="frame"/><child link="flap"/><origin xyz="0.2 0 0"/>
    <axis xyz="0 -1 0"/><limit lower="0" upper="1.6" effort="10" velocity="9"/><dynamics damping="0.05" friction="0.6"/>
  </joint>
  <joint name="spin" type="continuous"><parent link="frame"/><child link="dial"/><origin xyz="0 0 0.2"/>
    <axis xyz="0 0 1"/><dynamics damping="0.001" friction="0"/>
  </joint>
  <joint name="glue" type="fixed"><parent link="tray"/><child link="mark"/><origin xyz="0.1 0 0.01"/></joint>
</robot>
"""
"""A tray that opens towards -x, a flap, a dial and a lumped link with a frame; nothing says where its root is."""

MJCF = """<mujoco model="trolley"><worldbody><body name="frame"><freejoint/>
  <geom type="box" size="0.2 0.15 0.05" mass="4"/>
  <body name="tray" pos="0 0 0.1"><joint name="slide" type="slide" axis="1 0 0" range="-0.16 0" damping="1.5"
      frictionloss="0.8"/><geom type="box" size="0.1 0.1 0.01" mass="1"/><site name="mark" pos="0.1 0 0.01"/></body>
  <body name="flap" pos="0.2 0 0"><joint name="hinge" axis="0 -1 0" range="0 1.6" damping="0.05" frictionloss="0.6"/>
    <geom type="box" size="0.09 0.1 0.005" pos="0.1 0 0" mass="0.5"/></body>
  <body name="dial" pos="0 0 0.2"><joint name="spin" axis="0 0 1" damping="0.001"/>
    <geom type="cylinder" size="0.05 0.01" mass="0.2"/></body>
</body></worldbody><compiler angle="radian"/></mujoco>
"""
"""Much the same as a MuJoCo file with a floating root."""


def compiled(objects: dict[str, Any], dt: float = DT, **layout: Any) -> World:
    """Objects at the origin, or where `layout` says; a control step is a physics step."""
    places = {name: {"position": [0.0, 0.0, 0.0]} for name in objects} | layout
    physics = PhysicsSpec(dt=dt, control_dt=dt)
    return compile_world(WorldSpec.model_validate({"objects": objects, "layout": places}), physics=physics)


def trolley(folder: Path, kind: str, **more: Any) -> World:
    """The trolley of a file, two metres up."""
    file = folder / f"trolley.{kind}"
    file.write_text(URDF if kind == "urdf" else MJCF)
    thing = {"source": {"asset": f"file:{file}"}, **more}
    return compiled({"trolley": thing}, trolley={"position": [0.0, 0.0, 2.0]})


def about_axis(inertial: Inertial, joint: Joint) -> float:
    """The inertia [kg m^2] of a body about its joint's axis through the origin of its frame."""
    axis, com = np.array(joint.axis), np.array(inertial.com)
    xx, yy, zz, xy, xz, yz = inertial.inertia
    own = axis @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ axis
    return float(own + inertial.mass * (com @ com - (com @ axis) ** 2))


def pushed(force: float, inertia: float, joint: Joint, time: float) -> tuple[float, float]:
    """Position and velocity of a joint under a constant force above its dry friction, from rest at zero."""
    terminal, settling = (force - joint.friction) / joint.damping, inertia / joint.damping
    reached = 1 - np.exp(-time / settling)
    return terminal * (time - settling * reached), terminal * reached


def falling(inertial: Inertial, joint: Joint, start: float, time: float, step: float = 1e-5) -> tuple[float, float]:
    """Angle and rate of a lid hinged about -y that falls from rest, with dry and viscous friction of its hinge."""
    inertia, (x, _, z) = about_axis(inertial, joint), inertial.com
    q, v = start, 0.0
    for _ in range(round(time / step)):
        lever = np.cos(q) * x - np.sin(q) * z
        torque = -inertial.mass * 9.81 * lever + joint.friction - joint.damping * v
        v += step * torque / inertia
        q += step * v
    return q, v


def random_positions(world: World, rng: np.random.Generator, rows: int) -> Array:
    """Joint positions (rows, J) anywhere within the limits; turns where there are none."""
    low = np.array([max(joint.lower, -7.0) for joint in world.joints])
    high = np.array([min(joint.upper, 7.0) for joint in world.joints])
    return rng.uniform(low, high, (rows, len(world.joints)))


# ---------------------------------------------------------------------- a hand that opens a drawer

BY_HAND: dict[str, Any] = {
    "robots": {"panda": {"robot": "franka_panda"}},
    "objects": {
        "tray": {
            "source": {
                "procedural": "cabinet",
                "params": {"size": [0.2, 0.3, 0.15], "columns": [["drawer"]], "base": 0.0, "handle": {"length": 0.1}},
            },
            "fixed": True,
        }
    },
    "layout": {"tray": {"position": [0.0, 0.0, 0.0]}},
}
"""A drawer under a Panda's hand: it is turned so that its front looks up, and its bar lies between the fingers."""

IN_HAND = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""The axes of a handle in those of a tool that holds it: x against the approach, z along what the fingers close on."""


def by_hand(**joint: Any) -> World:
    """`BY_HAND` with the drawer's joint as given."""
    tray = {**BY_HAND["objects"]["tray"], "joints": {"drawer_1": joint}}
    spec = WorldSpec.model_validate({**BY_HAND, "objects": {"tray": tray}})
    return compile_world(spec, physics=PhysicsSpec(dt=DT, control_dt=10 * DT))


def under_the_hand(world: World, hand: Array) -> Array:
    """Where the tray's root (7,) must be for its handle to lie in a hand at this pose (7,)."""
    site = next(site for site in world.sites if site.name == "tray.drawer_1.handle")
    link = world.bodies[site.body]
    handle = P.compose(P.pose(link.position, link.quaternion), P.pose(site.position, site.quaternion))
    wanted = P.compose(hand, P.pose((0.0, 0.0, 0.0), tuple(P.from_matrix(IN_HAND).tolist())))
    return P.compose(wanted, P.inverse(handle))


def lifted(world: World, poses: Array, body: int, point: Array, joints: list[int], rise: float) -> Array:
    """Changes (K,) of an arm's joints that raise a point of a body [m] and do not turn it."""
    jacobian = frame_jacobians(world, poses)[body]
    jacobian[:3] += np.cross(jacobian[3:], (point - poses[body, :3]), axis=0)
    return np.linalg.pinv(jacobian[:, joints]) @ np.array([0.0, 0.0, rise, 0.0, 0.0, 0.0])
