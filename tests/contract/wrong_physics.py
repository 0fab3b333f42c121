"""Engines with wrong physics: MuJoCo, building a World that is not quite the one it was given.

Each stands for a default or a bug that real engines have been found with; `caught_by` names the tests that find it.
"""

from dataclasses import replace
from typing import ClassVar

import numpy as np

from anysim.conventions import IDENTITY_QUATERNION
from anysim.model.world import Capsule, Cylinder, World
from anysim_mujoco.engine import MujocoEngine


class Right(MujocoEngine):
    """Nothing is wrong with it."""

    caught_by: ClassVar[tuple[str, ...]] = ()

    def _spoil(self, world: World) -> World:
        return world

    def _build(self, world, num_envs):
        super()._build(self._spoil(world), num_envs)


class DampedJoints(Right):
    """Joints are damped by default."""

    caught_by = ("test_physics.py::test_nothing_slows_a_free_joint",)

    def _spoil(self, world):
        return replace(world, joints=tuple(replace(j, damping=j.damping + 0.05) for j in world.joints))


class RubbingJoints(Right):
    """Joints have dry friction by default."""

    caught_by = ("test_physics.py::test_nothing_slows_a_free_joint",)

    def _spoil(self, world):
        return replace(world, joints=tuple(replace(j, friction=max(j.friction, 0.05)) for j in world.joints))


class NoArmature(Right):
    """Armature is lost."""

    caught_by = ("test_parameters.py::test_parameters_begin_as_the_world_says",)

    def _spoil(self, world):
        return replace(world, joints=tuple(replace(j, armature=0.0) for j in world.joints))


class NoEffortLimit(Right):
    """Drives are not limited."""

    caught_by = ("test_commands.py::test_effort_is_clipped", "test_commands.py::test_blocked_drive_exerts_its_torque")

    def _spoil(self, world):
        return replace(world, actuators=tuple(replace(a, effort_limit=float("inf")) for a in world.actuators))


class WeakDrives(Right):
    """Gains are scaled by something."""

    caught_by = (
        "test_commands.py::test_blocked_drive_exerts_its_torque",
        "test_commands.py::test_position_drive_follows_its_law",
    )

    def _spoil(self, world):
        return replace(world, actuators=tuple(replace(a, kp=0.9 * a.kp) for a in world.actuators))


class OtherGravity(Right):
    """Gravity is 9.8, whatever the World says."""

    caught_by = ("test_physics.py::test_free_fall",)

    def _spoil(self, world):
        return replace(world, physics=replace(world.physics, gravity=(0.0, 0.0, -9.8)))


class OtherStep(Right):
    """The engine prefers its own step size."""

    caught_by = ("test_stepping.py::test_dt_is_the_worlds",)

    def _spoil(self, world):
        return replace(world, physics=replace(world.physics, dt=0.002))


class NoPriority(Right):
    """Priorities of surfaces are lost."""

    caught_by = ("test_physics.py::test_priority_decides",)

    def _spoil(self, world):
        return replace(world, geoms=tuple(replace(g, surface=replace(g.surface, priority=0)) for g in world.geoms))


class LowFriction(Right):
    """Friction combines to something lower than the larger coefficient."""

    caught_by = (
        "test_physics.py::test_the_larger_friction_counts",
        "test_physics.py::test_a_block_slides_down_a_steep_slope",
    )

    def _spoil(self, world):
        return replace(
            world,
            geoms=tuple(replace(g, surface=replace(g.surface, friction=0.5 * g.surface.friction)) for g in world.geoms),
        )


class NoBounce(Right):
    """Restitution is dropped."""

    caught_by = ("test_physics.py::test_bounce_height", "test_physics.py::test_collisions_keep_momentum")

    def _spoil(self, world):
        return replace(world, geoms=tuple(replace(g, surface=replace(g.surface, restitution=0.0)) for g in world.geoms))


class LyingShapes(Right):
    """Capsules and cylinders lie along x."""

    caught_by = ("test_physics.py::test_resting_height",)

    def _spoil(self, world):
        along_x = (0.0, 0.5**0.5, 0.0, 0.5**0.5)
        turned = [
            replace(g, quaternion=along_x if isinstance(g.shape, Capsule | Cylinder) else g.quaternion)
            for g in world.geoms
        ]
        return replace(world, geoms=tuple(turned))


class AllCollide(Right):
    """Excluded pairs are forgotten."""

    caught_by = ("test_physics.py::test_excluded_pairs_pass_through",)

    def _spoil(self, world):
        return replace(world, excluded_pairs=frozenset())


class OtherInertia(Right):
    """Inertia is recomputed from something else than the World."""

    caught_by = ("test_physics.py::test_double_pendulum_keeps_its_energy", "test_commands.py::test_a_torque_turns")

    def _spoil(self, world):
        bodies = [
            replace(b, inertial=b.inertial._replace(inertia=tuple(1.5 * v for v in b.inertial.inertia)))
            for b in world.bodies
        ]
        return replace(world, bodies=tuple(bodies))


class CentredMass(Right):
    """The centre of mass is taken to be the frame's origin."""

    caught_by = ("test_physics.py::test_a_throw_is_a_parabola",)

    def _spoil(self, world):
        return replace(
            world, bodies=tuple(replace(b, inertial=b.inertial._replace(com=(0.0, 0.0, 0.0))) for b in world.bodies)
        )


class ForceAtTheOrigin(Right):
    """Forces act at the frame's origin."""

    caught_by = ("test_commands.py::test_a_force_acts_at_the_centre_of_mass",)

    def apply_wrench(self, wrench, bodies, env_ids=None):
        force = np.asarray(wrench, dtype=float)
        arm = np.array(self.world.bodies[bodies[0]].inertial.com)
        super().apply_wrench(np.concatenate([force[:3], force[3:] - np.cross(arm, force[:3])]), bodies, env_ids)


class TurnedField(Right):
    """Height fields have rows and columns the other way round."""

    caught_by = ("test_physics.py::test_heightfields_are_where_they_say",)

    def _spoil(self, world):
        return replace(world, heightfields=tuple(replace(h, heights=h.heights.T.copy()) for h in world.heightfields))


class CentredMesh(Right):
    """Meshes are moved to their centre."""

    caught_by = ("test_physics.py::test_a_mesh_rests_on_its_hull",)

    def _spoil(self, world):
        return replace(
            world,
            meshes=tuple(replace(m, vertices=m.vertices - m.vertices.mean(0), hash="moved") for m in world.meshes),
        )


class LostAnchors(Right):
    """Joints turn about the link's origin, not about their anchor."""

    caught_by = (
        "test_conventions.py::test_links_are_where_kinematics_puts_them",
        "test_physics.py::test_pendulum_period",
    )

    def _spoil(self, world):
        return replace(world, joints=tuple(replace(j, anchor=(0.0, 0.0, 0.0)) for j in world.joints))


class LostTurns(Right):
    """The orientation of links' frames is lost."""

    caught_by = ("test_conventions.py::test_links_are_where_kinematics_puts_them",)

    def _spoil(self, world):
        return replace(
            world,
            bodies=tuple(replace(b, quaternion=IDENTITY_QUATERNION) if b.parent >= 0 else b for b in world.bodies),
        )


class Ghosts(Right):
    """What is absent is still there for contacts and rays."""

    caught_by = (
        "test_varying.py::test_nothing_touches_what_is_absent",
        "test_varying.py::test_what_is_there_moves_as_if_the_rest_were_not_in_the_world",
        "test_varying.py::test_no_ray_hits_what_is_absent",
    )

    def _populate(self, ids):
        return


class DrawsThePresent(Right):
    """Draws bodies where they are, whatever poses it is given."""

    caught_by = ("test_filming.py::test_recorded_poses_give_the_pictures_of_then",)

    def _render(self, view, ids, channels):
        return super()._render(replace(view, body_pose=self.get_state().body_pose[ids]), ids, channels)


class MovesToDraw(Right):
    """Writes the poses that it is to draw into its state."""

    caught_by = ("test_filming.py::test_drawing_an_earlier_moment_leaves_the_state_alone",)

    def _render(self, view, ids, channels):
        free = np.array([i for i, body in enumerate(self.world.bodies) if body.kind == "free"])
        self._retire_state()
        self._write_bodies(ids, free, view.body_pose[:, free], None)
        return super()._render(view, ids, channels)
