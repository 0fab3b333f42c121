"""Engines whose states no world can be in: flights, energy from nowhere, what is not finite; dead springs."""

from dataclasses import replace

import numpy as np
from wrong_physics import Right


def _index(engine, name):
    return next((i for i, body in enumerate(engine.world.bodies) if body.name == name), None)


class ThrowsABox(Right):
    """A box that touches something is at 1e68 m."""

    caught_by = ("test_stepping.py::test_the_same_run_twice", "test_stepping.py::test_equal_envs_stay_equal")

    def _read(self, name):
        array = super()._read(name)
        box = _index(self, "box")
        if name == "body_pose" and box is not None and self._records.ticks.max(initial=0) > 10:
            array[:, box, 0] = 1e68
        return array


class NoWorseThanFast(Right):
    """The ball of the everyday scene leaves it at a tenth of the speed of light."""

    caught_by = ("test_stepping.py::test_the_same_run_twice",)

    def _step(self, n_steps, ids):
        super()._step(n_steps, ids)
        ball = _index(self, "ball")
        if ball is not None:
            twist = np.tile([3e7, 0.0, 0.0, 0.0, 0.0, 0.0], (self.num_envs, 1, 1))
            self._write_bodies(self._all, np.array([ball]), None, twist)


class RunawayJoint(Right):
    """A joint turns to 1e9 rad."""

    caught_by = ("test_stepping.py::test_the_same_run_twice",)

    def _read(self, name):
        array = super()._read(name)
        return array + 1e9 if name == "joint_pos" and self._records.ticks.max(initial=0) > 10 else array


class EndlessForce(Right):
    """Contact sensors read a giganewton."""

    caught_by = ("test_touch.py::test_a_sliding_block_reads_its_friction",)

    def _read(self, name):
        array = super()._read(name)
        return array * 1e9 if name == "contact_force" else array


class SilentlyLost(Right):
    """An env that is not finite is not marked."""

    caught_by = ("test_stepping.py::test_the_same_run_twice",)

    def _read(self, name):
        array = super()._read(name)
        if name == "body_twist" and self._records.ticks.max(initial=0) > 10:
            array[-1] = np.nan
        return np.zeros_like(array) if name == "fault" else array


class LongQuaternions(Right):
    """Quaternions grow by a thousandth in a step."""

    caught_by = ("test_stepping.py::test_a_step_moves_what_moves",)

    def _read(self, name):
        array = super()._read(name)
        if name == "body_pose":
            array[..., 3:] *= 1.0 + 1e-3 * self._records.ticks.max(initial=0)
        return array


class HeatsUp(Right):
    """Joints gain a little speed in each step."""

    caught_by = ("test_physics.py::test_double_pendulum_keeps_its_energy",)

    def _step(self, n_steps, ids):
        for _ in range(n_steps):
            super()._step(1, ids)
            speed = self._read("joint_vel")
            self._write_joints(self._all, np.arange(speed.shape[1]), None, 1.0005 * speed)


class BouncesHigher(Right):
    """A touch gives back more than was there."""

    caught_by = ("test_physics.py::test_no_bounce_without_restitution",)

    def _step(self, n_steps, ids):
        free = np.array([i for i, body in enumerate(self.world.bodies) if body.kind == "free"], dtype=int)
        for _ in range(n_steps):
            before = self._read("body_twist")
            super()._step(1, ids)
            after = self._read("body_twist")
            turned = (before[:, free, 2] < -0.3) & (after[:, free, 2] > before[:, free, 2] + 0.1)
            if turned.any():
                twist = after[:, free].copy()
                twist[..., 2] = np.where(turned, -1.3 * before[:, free, 2], twist[..., 2])
                self._write_bodies(self._all, free, None, twist)


class ClaimsJointSprings(Right):
    """Springs pull at nothing."""

    caught_by = ("test_physics.py::test_a_spring_swings_about_its_rest",)

    def _spoil(self, world):
        return replace(world, joints=tuple(replace(joint, stiffness=0.0) for joint in world.joints))


class SpringsToZero(Right):
    """Springs pull to zero, not to their rest."""

    caught_by = ("test_physics.py::test_a_spring_pulls_beside_the_drive",)

    def _spoil(self, world):
        return replace(world, joints=tuple(replace(joint, spring_rest=0.0) for joint in world.joints))
