"""The Pinocchio model of one robot of a World, with which every controller that knows mechanics computes.

Joints keep the World's order (depth first), so a vector of joint positions means the same here and in an engine. A
floating robot has Pinocchio's free-flyer first: `nq = 7 + J`, `nv = 6 + J`; its velocity is in the base's own frame.
A joint that follows another (mimic) is a joint of its own here; `expand` gives it its place and `reduce` sums what
acts on it up at its leader.
"""

from functools import cached_property
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.errors import NameLookupError, PluginError, listing, suggest
from anysim.kinematics.inertia import tensor
from anysim.math import pose as P
from anysim.model.world import BodyKind, JointType, World


def pinocchio() -> Any:
    """The module, imported when something needs it.

    Raises:
        PluginError: it is not installed; says how to get it.
    """
    try:
        import pinocchio  # pyright: ignore[reportMissingImports]  (found by its .pth file)

        return pinocchio
    except ImportError as error:
        raise PluginError(f"kinematics of robots need Pinocchio ({error}): pip install 'anysim[kinematics]'") from None


class RobotModel:
    """A robot's mechanics. Not safe for two threads at once: Pinocchio's `data` is scratch space.

    Attributes:
        model, data: Pinocchio's, for those who call it directly.
        floating: whether the base is free.
        joints: (J,) world indices of the robot's joints, in the model's order.
        joint_names: their names without the robot's.
        root: the name of the base's frame; it is called `base` as well, unless another link is.
        lower, upper, velocity_limit, effort_limit: (J,) of the World.
    """

    def __init__(self, world: World, robot: str) -> None:
        pin = pinocchio()
        entity = next((e for e in world.entities if e.name == robot), None)
        if entity is None:
            known = [r.name for r in world.robots]
            raise NameLookupError(f"there is no robot '{robot}'{suggest(robot, known)} (robots: {listing(known)})")
        self.name, self._world = robot, world
        self.floating = world.bodies[entity.root].kind is BodyKind.FREE
        self.joints = np.arange(entity.joint_start, entity.joint_stop)
        picked = [world.joints[j] for j in self.joints]
        self.joint_names = tuple(j.name.removeprefix(f"{robot}.") for j in picked)
        self.lower = np.array([j.lower for j in picked])
        self.upper = np.array([j.upper for j in picked])
        self.velocity_limit = np.array([j.velocity_limit for j in picked])
        self.effort_limit = np.array([j.effort_limit for j in picked])
        self.initial = np.array([j.initial for j in picked])
        self.model = pin.Model()
        self.model.name = robot
        self.model.gravity.linear = np.array(world.physics.gravity)
        self._frames: dict[str, int] = {}
        parents = {entity.root: self._add_root(entity.root)}
        for body in range(entity.root + 1, entity.body_stop):
            parents[body] = self._add_link(body, parents[world.bodies[body].parent], entity.root)
        for body, joint in parents.items():
            anchor = P.pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
            self._add_frame(world.bodies[body].name, joint, self._in_joint(body, anchor))
        for site in world.sites:
            if site.body in parents:
                pose = P.pose(site.position, site.quaternion)
                self._add_frame(site.name, parents[site.body], self._in_joint(site.body, pose))
        self.root = world.bodies[entity.root].name.removeprefix(f"{robot}.")
        if self.root == robot:
            self.root = "base"
        self._frames.setdefault("base", self._frames[self.root])
        self.data = self.model.createData()

    # ------------------------------------------------------------------ building

    def _add_root(self, body: int) -> int:
        pin = pinocchio()
        if not self.floating:
            return 0
        joint = self.model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
        self.model.addJointFrame(joint)  # pin.buildReducedModel needs one of each joint, before those on it
        self.model.appendBodyToJoint(joint, self._inertia(body), pin.SE3.Identity())
        return joint

    def _add_link(self, body: int, parent: int, root: int) -> int:
        """A joint's frame is the body's, shifted to the axis: Pinocchio's axes pass through the frame's origin."""
        pin = pinocchio()
        frame = self._world.bodies[body]
        index = self._world.body_joint[body]
        joint = self._world.joints[index]
        axis = np.array(joint.axis)
        kind = (
            pin.JointModelPrismaticUnaligned if joint.type is JointType.PRISMATIC else pin.JointModelRevoluteUnaligned
        )
        rest = P.pose(frame.position, frame.quaternion)
        if frame.parent == root and not self.floating:
            above = P.pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        else:
            above = self._in_joint(frame.parent, P.pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
        placement = P.compose(P.compose(above, rest), P.pose(joint.anchor, (0.0, 0.0, 0.0, 1.0)))
        name = joint.name.removeprefix(f"{self.name}.")
        added = self.model.addJoint(
            parent,
            kind(axis),
            se3(placement),
            name,
            np.array([min(joint.effort_limit, 1e6)]),
            np.array([min(joint.velocity_limit, 1e6)]),
            np.array([max(joint.lower, -1e6)]),
            np.array([min(joint.upper, 1e6)]),
        )
        self.model.addJointFrame(added)
        self.model.armature[self.model.joints[added].idx_v] = joint.armature
        shift = se3(self._in_joint(body, P.pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))))
        self.model.appendBodyToJoint(added, self._inertia(body), shift)
        return added

    def _in_joint(self, body: int, pose: Array) -> Array:
        """A pose in a body's frame, in the frame of the Pinocchio joint that moves it."""
        joint = self._world.body_joint[body]
        if joint < 0:
            return pose
        anchor = np.array(self._world.joints[joint].anchor)
        return P.compose(P.pose(tuple(-anchor), (0.0, 0.0, 0.0, 1.0)), pose)

    def _inertia(self, body: int) -> Any:
        pin = pinocchio()
        inertial = self._world.bodies[body].inertial
        return pin.Inertia(inertial.mass, np.array(inertial.com), tensor(inertial))

    def _add_frame(self, name: str, joint: int, pose: Array) -> None:
        pin = pinocchio()
        local = name.removeprefix(f"{self.name}.") if name != self.name else "base"
        if local not in self._frames:
            frame = pin.Frame(local, joint, se3(pose), pin.FrameType.OP_FRAME)
            self._frames[local] = self.model.addFrame(frame, False)

    # ------------------------------------------------------------------ names and vectors

    def frame(self, name: str) -> int:
        """Pinocchio's index of a tool, sensor, link or body; `base` is the root's, unless another link is called so.

        Raises:
            NameLookupError: lists what exists.
        """
        if name not in self._frames:
            known = list(self._frames)
            raise NameLookupError(
                f"robot '{self.name}' has no frame '{name}'{suggest(name, known)} (frames: {listing(known, 20)})"
            )
        return self._frames[name]

    @property
    def frames(self) -> dict[str, int]:
        """Pinocchio's indices of all frames by name."""
        return dict(self._frames)

    def columns(self, joints: Array) -> Array:
        """Where world joints stand among the robot's J."""
        return np.asarray(joints) - self.joints[0] if len(self.joints) else np.asarray(joints)

    def q(self, joint_pos: Array, base: Array | None = None) -> Array:
        """Pinocchio's configuration (nq,) of joint positions (J,) and, if floating, the base's world pose (7,)."""
        if not self.floating:
            return np.array(joint_pos, dtype=float)
        pose = P.pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)) if base is None else base
        return np.concatenate([pose, joint_pos])

    def v(self, joint_vel: Array, base: Array | None = None, twist: Array | None = None) -> Array:
        """Pinocchio's velocity (nv,) of joint rates (J,) and, if floating, of the base: world pose and twist."""
        if not self.floating:
            return np.array(joint_vel, dtype=float)
        if base is None or twist is None:
            return np.concatenate([np.zeros(6), joint_vel])
        own = P.rotate_inverse(base[3:], np.asarray(twist).reshape(2, 3)).reshape(6)
        return np.concatenate([own, joint_vel])

    @cached_property
    def mass(self) -> float:
        """[kg] of all that moves."""
        return float(sum(inertia.mass for inertia in self.model.inertias))

    # ------------------------------------------------------------------ what is computed

    def frame_pose(self, q: Array, frame: int) -> Array:
        """Pose (7,) [m, xyzw] of a frame: in the world of a floating robot, in the base's frame of a fixed one."""
        pin = pinocchio()
        pin.forwardKinematics(self.model, self.data, q)
        return from_se3(pin.updateFramePlacement(self.model, self.data, frame))

    def frame_jacobian(self, q: Array, frame: int) -> Array:
        """(6, nv): linear velocity of the frame's origin and its rate, in world-aligned axes, per joint velocity."""
        pin = pinocchio()
        return pin.computeFrameJacobian(self.model, self.data, q, frame, pin.LOCAL_WORLD_ALIGNED)

    def com(self, q: Array) -> Array:
        """Centre of mass (3,) [m], in the axes of `frame_pose`."""
        pin = pinocchio()
        return np.array(pin.centerOfMass(self.model, self.data, q))

    def mass_matrix(self, q: Array) -> Array:
        """(nv, nv), armature included."""
        pin = pinocchio()
        upper = np.triu(pin.crba(self.model, self.data, q))
        matrix = upper + np.triu(upper, 1).T
        matrix[np.diag_indices(len(matrix))] += 0.0 if self._crba_has_armature else self.model.armature
        return matrix

    @cached_property
    def _crba_has_armature(self) -> bool:
        """Pinocchio's crba adds the armature since 2.7; ask it rather than its version."""
        pin = pinocchio()
        model, joint = pin.Model(), pin.JointModelRZ()
        added = model.addJoint(0, joint, pin.SE3.Identity(), "j")
        model.appendBodyToJoint(added, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
        model.armature[0] = 1.0
        return bool(pin.crba(model, model.createData(), np.zeros(1))[0, 0] > 1.5)

    def inverse_dynamics(self, q: Array, v: Array, a: Array) -> Array:
        """Generalised efforts (nv,) that give the acceleration `a` where nothing is touched (RNEA)."""
        return np.array(pinocchio().rnea(self.model, self.data, q, v, a))


def se3(pose: Array) -> Any:
    """Pinocchio's SE3 of a pose (7,) [m, xyzw]."""
    return pinocchio().XYZQUATToSE3(np.asarray(pose, dtype=float))


def from_se3(placement: Any) -> Array:
    """Pose (7,) [m, xyzw] of Pinocchio's SE3."""
    return np.array(pinocchio().SE3ToXYZQUAT(placement))
