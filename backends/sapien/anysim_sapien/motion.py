"""Poses and velocities of root bodies and joints, in and out of a scene."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim_sapien.scene import EnvScene


class Motion(NamedTuple):
    """The state of an env as PhysX keeps it, so that it goes back with the same bits.

    Poses (B, 7), and velocities (B, 6) of the centres of mass, are those of root bodies, else 0; joints are (J,).
    """

    pose: Array
    velocity: Array
    joint_pos: Array
    joint_vel: Array


def motion_of(scene: EnvScene) -> Motion:
    """Copy it out; what is not there is 0."""
    layout = scene.layout
    roots = (layout.free | layout.fixed)[:, None]
    pose = np.where(roots, scene.poses(), 0.0)
    return Motion(pose, scene.velocities(), scene.joint_positions(), scene.joint_velocities())


def put_motion(scene: EnvScene, motion: Motion) -> None:
    """Write what `motion_of` returned of a scene with the same things in it."""
    layout = scene.layout
    for body in np.flatnonzero(layout.free | layout.fixed):
        scene.place_body(int(body), motion.pose[body])
        if layout.free[body]:
            scene.push_body(int(body), motion.velocity[body, :3], motion.velocity[body, 3:])
    scene.place_joints(motion.joint_pos, motion.joint_vel)


def twists_of(scene: EnvScene, bodies: Array, turn: Array) -> Array:
    """Velocities of free roots' frame origins and their rates (K, 6), world axes; `turn` (K, 4) is how they lie.

    PhysX gives the velocity of the centre of mass; the origin's differs by the rate x the arm.
    """
    velocity = scene.velocities()[bodies]
    rate = velocity[:, 3:]
    return np.concatenate([velocity[:, :3] - P.cross(rate, P.rotate(turn, scene.com[bodies])), rate], axis=-1)


def put_twists(scene: EnvScene, bodies: Array, twists: Array, turn: Array) -> None:
    """Write twists (K, 6) of free roots, as `twists_of` returns them, at their orientations (K, 4)."""
    linear = twists[:, :3] + P.cross(twists[:, 3:], P.rotate(turn, scene.com[bodies]))
    for row, body in enumerate(bodies.tolist()):
        scene.push_body(body, linear[row], twists[row, 3:])
