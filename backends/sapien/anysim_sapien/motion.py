"""Poses and velocities of root bodies and joints, in and out of a scene."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array, xyzw_from_wxyz
from anysim.math import pose as P
from anysim_sapien.layout import Layout
from anysim_sapien.scene import EnvScene
from anysim_sapien.shapes import to_pose


class Motion(NamedTuple):
    """The state of an env as PhysX keeps it, so that it goes back with the same bits.

    Poses (B, 7), and velocities (B, 6) of the centres of mass, are those of root bodies, else 0; joints are (J,).
    """

    pose: Array
    velocity: Array
    joint_pos: Array
    joint_vel: Array


def motion_of(scene: EnvScene, layout: Layout) -> Motion:
    """Copy it out."""
    roots = (layout.free | layout.fixed)[:, None]
    velocity = np.zeros((len(scene.bodies), 6))
    for body in np.flatnonzero(layout.free):
        component = scene.bodies[body]
        velocity[body] = [*component.linear_velocity, *component.angular_velocity]
    return Motion(np.where(roots, scene.poses(), 0.0), velocity, scene.joint_positions(), scene.joint_velocities())


def put_motion(scene: EnvScene, layout: Layout, motion: Motion) -> None:
    """Write what `motion_of` returned."""
    for body in np.flatnonzero(layout.free | layout.fixed):
        scene.entities[body].set_pose(to_pose(motion.pose[body]))
        if layout.free[body]:
            _put_velocity(scene, layout, int(body), motion.velocity[body, :3], motion.velocity[body, 3:])
    scene.place_joints(motion.joint_pos, motion.joint_vel)


def _put_velocity(scene: EnvScene, layout: Layout, body: int, linear: Array, rate: Array) -> None:
    """Of the centre of mass, which is what PhysX takes."""
    tree = layout.tree_of[body]
    if tree >= 0:
        scene.trees[tree].handle.set_root_linear_velocity(linear)
        scene.trees[tree].handle.set_root_angular_velocity(rate)
    else:
        scene.bodies[body].set_linear_velocity(linear)
        scene.bodies[body].set_angular_velocity(rate)


def _arm(scene: EnvScene, body: int) -> Array:
    """From the frame's origin to the centre of mass, in world axes."""
    turn = xyzw_from_wxyz(np.asarray(scene.entities[body].pose.q, dtype=float))
    return P.rotate(turn, np.asarray(scene.bodies[body].cmass_local_pose.p, dtype=float))


def twist_of(scene: EnvScene, body: int) -> Array:
    """Velocity of a root's frame origin and its rate (6,), world axes."""
    component = scene.bodies[body]
    rate = np.asarray(component.angular_velocity, dtype=float)
    linear = np.asarray(component.linear_velocity, dtype=float) - P.cross(rate, _arm(scene, body))
    return np.concatenate([linear, rate])


def put_twist(scene: EnvScene, layout: Layout, body: int, twist: Array) -> None:
    """Write what `twist_of` returns."""
    _put_velocity(scene, layout, body, twist[:3] + P.cross(twist[3:], _arm(scene, body)), twist[3:])
