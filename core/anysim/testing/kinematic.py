"""The kinematic engine: bodies and joints move by their velocities alone. It is for tests of everything but physics.

There is no gravity, no contact and no force. A free body's pose integrates its twist. A joint integrates its velocity
and stops at its limits. A position drive brings its joint towards the target by at most the joint's velocity limit, so
that without one the joint is there after one step; a velocity drive gives its joint the velocity at once; an effort
drive does nothing. Parameters are stored and read back, and change nothing else. All arithmetic is elementwise, so an
env's result is the same bits whatever the number of envs.
"""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from anysim import __version__
from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.capability import Capabilities, Capability as C
from anysim.engine.control import POSITION, VELOCITY, Control
from anysim.engine.parameters import PARAMETERS, ParameterTable
from anysim.engine.presence import Lifecycle
from anysim.engine.state import Availability, ContactPoints, SnapshotLevel
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import BodyKind, JointType, World

_IGNORED = "ignored: kinematic engine"


class KinematicEnvs:
    """All that a build makes: the state of N envs with B bodies and J joints, and what their world says of joints."""

    def __init__(self, world: World, num_envs: int) -> None:
        n, bodies, joints = num_envs, len(world.bodies), len(world.joints)
        self.roots = np.zeros((n, bodies, 7))
        self.twists = np.zeros((n, bodies, 6))
        self.position = np.zeros((n, joints))
        self.velocity = np.zeros((n, joints))
        self.lower = np.array([j.lower for j in world.joints])
        self.upper = np.array([j.upper for j in world.joints])
        self.speed_limit = np.array([j.velocity_limit for j in world.joints])
        self.driven = np.array([a.joint for a in world.actuators], dtype=int)
        self.followers = [(i, j.mimic) for i, j in enumerate(world.joints) if j.mimic is not None]
        self.control: Control | None = None
        self.table = ParameterTable(world, n)


class NullEngine(SimEngine):
    """See the module's docstring."""

    name = "null"
    capabilities = Capabilities.of(
        C.RIGID_BODIES,
        C.ARTICULATIONS,
        C.MIMIC_JOINTS,
        C.JOINT_LIMITS,
        C.SNAPSHOT_STATE,
        C.SNAPSHOT_TRAJECTORY,
        C.VARYING_ENTITIES,
        C.PARAMETERS_PER_ENV,
        approximate={
            C.CONTROL_POSITION: "the joint moves to its target at its velocity limit, whatever the gains",
            C.CONTROL_VELOCITY: "the joint has its target velocity at once, whatever the gains",
            C.CONTROL_EFFORT: _IGNORED,
            C.VELOCITY_LIMITS: "position drives alone heed them, and always",
            C.CONTACT_SENSORS: "read zero: kinematic engine",
            C.CONTACT_POINTS: "there are none: kinematic engine",
            **dict.fromkeys(
                (
                    C.CONTACTS_STATIC,
                    C.CONTACTS_MOVING,
                    C.TERRAIN_PLANE,
                    C.TERRAIN_HEIGHTFIELD,
                    C.TERRAIN_TRIMESH,
                    C.SHAPE_MESH,
                    C.JOINT_FRICTION,
                    C.JOINT_SPRINGS,
                    C.TENDONS,
                    C.TENDON_LIMITS,
                    C.SPATIAL_TENDONS,
                    C.COMPLIANCE,
                    C.ARMATURE,
                    C.EFFORT_LIMITS,
                    C.ACTUATION_EXPLICIT,
                    C.ACTUATION_NATIVE,
                    C.GRAVITY_COMPENSATION,
                    C.RESTITUTION,
                    C.TORSIONAL_FRICTION,
                    C.BODY_DAMPING,
                    C.SOLVER_SETTINGS,
                ),
                _IGNORED,
            ),
        },
    )
    lifecycle: ClassVar[Lifecycle] = Lifecycle.P2
    parameters: ClassVar[frozenset[str]] = frozenset(PARAMETERS)

    @classmethod
    def availability(cls) -> Availability:
        """It needs nothing but numpy, so it always runs."""
        return Availability(True, __version__)

    # ------------------------------------------------------------------ lifecycle

    def _build(self, world: World, num_envs: int) -> None:
        self._envs = KinematicEnvs(world, num_envs)

    def _free(self) -> None:
        del self._envs

    def _reset(self, ids: Array) -> None:
        self._envs.roots[ids] = self.world.initial_body_pose
        self._envs.twists[ids] = 0.0
        self._envs.position[ids] = [j.initial for j in self.world.joints]
        self._envs.velocity[ids] = 0.0

    def _populate(self, ids: Array) -> None:
        """Nothing touches or sees anything here, so nothing has to leave: what is absent moves unseen."""

    # ------------------------------------------------------------------ stepping

    def _step(self, n_steps: int, ids: Array | None) -> None:
        rows = np.arange(self.num_envs) if ids is None else ids
        dt = self.world.physics.dt
        for _ in range(n_steps):
            self._move_bodies(rows, dt)
            self._move_joints(rows, dt)

    def _move_bodies(self, rows: Array, dt: float) -> None:
        twist = self._envs.twists[rows]
        pose = self._envs.roots[rows]
        moving = (twist != 0.0).any(axis=-1)  # a body at rest keeps its bits
        rate = P.norm(twist[..., 3:])
        axis = twist[..., 3:] / np.where(rate == 0.0, 1.0, rate)[..., None]
        turned = P.normalize(P.multiply(P.from_axis_angle(axis, rate * dt), pose[..., 3:]))
        moved = np.concatenate([pose[..., :3] + twist[..., :3] * dt, turned], axis=-1)
        self._envs.roots[rows] = np.where(moving[..., None], moved, pose)

    def _move_joints(self, rows: Array, dt: float) -> None:
        envs = self._envs
        position, velocity = envs.position[rows], envs.velocity[rows]
        goal = position + velocity * dt
        if len(envs.driven):
            assert envs.control is not None
            mode, target, reach = envs.control.mode[rows], envs.control.position[rows], envs.speed_limit[envs.driven]
            here = position[:, envs.driven]
            direct = (target - here) / dt
            rate = np.where(mode == VELOCITY, envs.control.velocity[rows], velocity[:, envs.driven])
            rate = np.where(mode == POSITION, direct, rate)
            velocity[:, envs.driven] = np.clip(rate, -reach, reach)
            # a joint that arrives gets the target's own bits, which a sum would round
            arrives = (mode == POSITION) & (np.abs(direct) <= reach)
            goal[:, envs.driven] = np.where(arrives, target, here + velocity[:, envs.driven] * dt)
        velocity[(goal < envs.lower) | (goal > envs.upper)] = 0.0
        goal = np.clip(goal, envs.lower, envs.upper)
        for joint, mimic in envs.followers:
            goal[:, joint] = mimic.multiplier * goal[:, mimic.joint] + mimic.offset
            velocity[:, joint] = mimic.multiplier * velocity[:, mimic.joint]
        envs.position[rows], envs.velocity[rows] = goal, velocity

    # ------------------------------------------------------------------ reading and writing

    def _read(self, name: str) -> Array:
        n = self.num_envs
        if name == "body_pose":
            return forward_kinematics(self.world, self._envs.roots, self._envs.position)
        if name == "body_twist":
            return self._forward_twists()
        if name == "joint_pos":
            return self._envs.position.copy()
        if name == "joint_vel":
            return self._envs.velocity.copy()
        if name == "joint_effort":
            return np.zeros_like(self._envs.position)
        if name == "contact_force":
            return np.zeros((n, len(self.world.contact_sensors), 3))
        state = (self._envs.roots, self._envs.twists, self._envs.position, self._envs.velocity)
        return np.array([not all(np.isfinite(part[i]).all() for part in state) for i in range(n)], dtype=bool)

    def _contacts(self, ids: Array) -> ContactPoints:
        return ContactPoints.joined([])

    def _forward_twists(self) -> Array:
        """World twists (N, B, 6): a link's is its parent's, carried to its origin, plus what its joint adds."""
        world = self.world
        poses = forward_kinematics(world, self._envs.roots, self._envs.position)
        twists = self._envs.twists.copy()
        for i, body in enumerate(world.bodies):
            if body.kind is not BodyKind.LINK:
                continue
            joint = world.joints[world.body_joint[i]]
            parent, rate = twists[:, body.parent], self._envs.velocity[:, world.body_joint[i], None]
            linear = parent[:, :3] + P.cross(parent[:, 3:], poses[:, i, :3] - poses[:, body.parent, :3])
            axis = P.rotate(poses[:, i, 3:], np.broadcast_to(joint.axis, (len(poses), 3)))
            if joint.type is JointType.PRISMATIC:
                twists[:, i] = np.concatenate([linear + axis * rate, parent[:, 3:]], axis=-1)
            else:
                arm = P.rotate(poses[:, i, 3:], np.broadcast_to(joint.anchor, (len(poses), 3)))
                turning = P.cross(axis * rate, -arm)
                twists[:, i] = np.concatenate([linear + turning, parent[:, 3:] + axis * rate], axis=-1)
        return twists

    def _write_joints(self, ids: Array, joints: Array, position: Array | None, velocity: Array | None) -> None:
        if position is not None:
            self._envs.position[np.ix_(ids, joints)] = position
        if velocity is not None:
            self._envs.velocity[np.ix_(ids, joints)] = velocity

    def _write_bodies(self, ids: Array, bodies: Array, pose: Array | None, twist: Array | None) -> None:
        if pose is not None:
            self._envs.roots[np.ix_(ids, bodies)] = pose
        if twist is not None:
            self._envs.twists[np.ix_(ids, bodies)] = twist

    def _apply_control(self, control: Control) -> None:
        self._envs.control = Control(*(part.copy() for part in control))

    # ------------------------------------------------------------------ parameters and snapshots

    def _get_parameter(self, name: str) -> Array:
        return self._envs.table.get(name)

    def _set_parameter(self, name: str, values: Array, ids: Array, indices: Array) -> None:
        self._envs.table.set(name, values, ids, indices)

    def _default_parameter(self, name: str) -> Array:
        return self._envs.table.default(name)

    def _snapshot(self, ids: Array, level: SnapshotLevel) -> dict[str, Array]:
        return {
            "roots": self._envs.roots[ids],
            "twists": self._envs.twists[ids],
            "position": self._envs.position[ids],
            "velocity": self._envs.velocity[ids],
        }

    def _restore(self, ids: Array, data: Mapping[str, Array], level: SnapshotLevel) -> None:
        self._envs.roots[ids], self._envs.twists[ids] = data["roots"], data["twists"]
        self._envs.position[ids], self._envs.velocity[ids] = data["position"], data["velocity"]
