"""The serial chain from a robot's root body to one of its tools, as plain arrays that any solver can read."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Self, TypeVar

import numpy as np

from anysim.conventions import IDENTITY_QUATERNION, Array
from anysim.errors import AnysimError, NameLookupError, listing, suggest
from anysim.math import pose as P
from anysim.model.forward_kinematics import joint_pose
from anysim.model.index import Index
from anysim.model.world import ORIGIN, JointType, Robot, World

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Chain:
    """K joints in a row. Read-only arrays; poses are `[x, y, z, qx, qy, qz, qw]`, units SI.

    With `q` the joint positions, `move_k` the motion of joint k (about or along `axis[k]` through `anchor[k]`) and
    `base` the world pose of the root body, the tool is at

        base ∘ rest[0] ∘ move_0(q_0) ∘ rest[1] ∘ move_1(q_1) ∘ … ∘ tool_offset

    Attributes:
        name: `robot.channel -> tool`, for messages.
        root: the world index of the body that `base` is the pose of.
        joints: (K,) world joint indices, from the root to the tool.
        joint_names: their names.
        prismatic: (K,) bool; the others are revolute.
        rest: (K, 7) a joint's body frame at zero in the frame of the previous joint's body (the root's for the first).
        anchor: (K, 3) a point on the axis, in the joint's body frame.
        axis: (K, 3) unit, in the joint's body frame.
        lower: (K,) limits, may be infinite.
        upper: (K,) limits, may be infinite.
        velocity_limit: (K,) [rad/s] or [m/s], may be infinite.
        initial: (K,) the positions after a reset.
        tool_offset: (7,) the tool in the frame of the last joint's body.
    """

    name: str
    root: int
    joints: Array
    joint_names: tuple[str, ...]
    prismatic: Array
    rest: Array
    anchor: Array
    axis: Array
    lower: Array
    upper: Array
    velocity_limit: Array
    initial: Array
    tool_offset: Array

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                frozen = np.array(value, order="C")
                frozen.setflags(write=False)
                object.__setattr__(self, field.name, frozen)

    def __len__(self) -> int:
        """The number of joints K."""
        return len(self.joints)

    @classmethod
    def from_world(
        cls, world: World, robot: str, channel: str, tool: str, *, joints: Sequence[int] | Array | None = None
    ) -> Self:
        """The chain that the joints of a robot's channel form under its tool; or some of them, world indices.

        Joints on the way that the channel does not command are held at their initial position. Columns go from the root
        to the tool, whatever the order of the channel; `joints` tells which is which.

        Raises:
            NameLookupError: no such robot, channel or tool.
            AnysimError: the tool does not hang below every joint of the channel, or a joint on the way is coupled
                (mimic) to one of the channel's.
        """
        index = Index(world)
        model = index.robot(robot)
        whole = _part(model, "channel", model.channels, channel).joints
        chosen = whole if joints is None else tuple(int(j) for j in joints)
        site = world.sites[_part(model, "tool", model.tools, tool)]
        name = f"{robot}.{channel} -> {tool}"
        root = index.entity(robot).root
        path = _path(world, root, site.body, name)
        _check_path(world, chosen, path, name, tool)

        held = P.pose(ORIGIN, IDENTITY_QUATERNION)  # what lies between the last moving joint and here
        rest: list[Array] = []
        order: list[int] = []
        for body in path:
            frame = world.bodies[body]
            held = P.compose(held, P.pose(frame.position, frame.quaternion))
            joint = world.body_joint[body]
            if joint in chosen:
                rest.append(held)
                order.append(joint)
                held = P.pose(ORIGIN, IDENTITY_QUATERNION)
            else:
                held = P.compose(held, joint_pose(world, joint, np.array(world.joints[joint].initial)))
        picked = [world.joints[j] for j in order]
        return cls(
            name=name,
            root=root,
            joints=np.array(order, dtype=np.int64),
            joint_names=tuple(j.name for j in picked),
            prismatic=np.array([j.type is JointType.PRISMATIC for j in picked]),
            rest=np.array(rest),
            anchor=np.array([j.anchor for j in picked], dtype=float),
            axis=np.array([j.axis for j in picked], dtype=float),
            lower=np.array([j.lower for j in picked]),
            upper=np.array([j.upper for j in picked]),
            velocity_limit=np.array([j.velocity_limit for j in picked]),
            initial=np.array([j.initial for j in picked]),
            tool_offset=P.compose(held, P.pose(site.position, site.quaternion)),
        )

    def tool_pose(self, base: Array, joint_pos: Array) -> Array:
        """World poses (..., 7) of the tool, for root poses (..., 7) and joint positions (..., K).

        Elementwise: a row's result does not depend on the batch around it.
        """
        pose = np.asarray(base, dtype=float)
        joint_pos = np.asarray(joint_pos, dtype=float)
        for k in range(len(self)):
            pose = P.compose(P.compose(pose, self.rest[k]), self._move(k, joint_pos[..., k]))
        return P.compose(pose, self.tool_offset)

    def _move(self, k: int, position: Array) -> Array:
        axis = np.broadcast_to(self.axis[k], (*position.shape, 3))
        if self.prismatic[k]:
            still = np.broadcast_to(IDENTITY_QUATERNION, (*position.shape, 4))
            return np.concatenate([axis * position[..., None], still], axis=-1)
        turn = P.from_axis_angle(axis, position)
        anchor = np.broadcast_to(self.anchor[k], axis.shape)
        return np.concatenate([anchor - P.rotate(turn, anchor), turn], axis=-1)


def _part(robot: Robot, kind: str, parts: Mapping[str, T], name: str) -> T:
    if name not in parts:
        known = list(parts)
        raise NameLookupError(
            f"robot '{robot.name}' has no {kind} '{name}'{suggest(name, known)} ({kind}s: {listing(known)})"
        )
    return parts[name]


def _path(world: World, root: int, body: int, name: str) -> list[int]:
    """The bodies after `root` down to `body`, in that order."""
    path: list[int] = []
    while body != root:
        if body < 0 or world.body_joint[body] < 0:
            raise AnysimError(
                f"chain {name}: the tool does not hang from the root body '{world.bodies[root].name}'; "
                f"a tool must be a site on a body of its own robot"
            )
        path.append(body)
        body = world.bodies[body].parent
    return path[::-1]


def _check_path(world: World, joints: tuple[int, ...], path: list[int], name: str, tool: str) -> None:
    on_path = [world.body_joint[b] for b in path]
    if not joints:
        raise AnysimError(f"chain {name}: the channel has no joints; inverse kinematics needs at least one")
    beside = [world.joints[j].name for j in joints if j not in on_path]
    if beside:
        raise AnysimError(
            f"chain {name}: the tool is not below {listing(beside)}; every joint of the channel must lie between the "
            f"root and the tool (joints above '{tool}': {listing([world.joints[j].name for j in on_path])})"
        )
    for j in on_path:
        mimic = world.joints[j].mimic
        if mimic is not None and (j in joints or mimic.joint in joints):
            raise AnysimError(
                f"chain {name}: joint '{world.joints[j].name}' follows '{world.joints[mimic.joint].name}' (mimic); "
                f"a chain needs joints that move independently"
            )
