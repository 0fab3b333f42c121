"""Twists of links from joint velocities: sums over the joints between a link and its root.

For libraries whose own velocities of links belong to the poses before the step (PhysX).
"""

import numpy as np

from anysim.conventions import Array
from anysim.math.compiled import compiled
from anysim.model.world import BodyKind, JointType, World
from anysim_mechanics.trees import members


class LinkTwists:
    """The constants of a World, made once."""

    def __init__(self, world: World) -> None:
        body = np.array([j.body for j in world.joints], dtype=int)
        axis, anchor = (np.array([getattr(j, name) for j in world.joints], dtype=float) for name in ("axis", "anchor"))
        turns = np.array([j.type is JointType.REVOLUTE for j in world.joints], dtype=float)
        of = {body: root for root, bodies in members(world).items() for body in bodies}
        free = np.array([i for i, b in enumerate(world.bodies) if b.kind is BodyKind.FREE], dtype=int)
        links = np.array([i for i, b in enumerate(world.bodies) if b.kind is BodyKind.LINK], dtype=int)
        root = np.array([of[i] for i in links.tolist()], dtype=int)
        chains: dict[int, list[int]] = {}
        for i in links.tolist():
            # sums run up the joints' numbers
            chains[i] = sorted([*chains.get(world.bodies[i].parent, ()), world.body_joint[i]])
        first = np.cumsum([0, *(len(chain) for chain in chains.values())])
        chain = np.array([joint for chain in chains.values() for joint in chain], dtype=int)
        joints = body, axis.reshape(-1, 3), anchor.reshape(-1, 3), turns
        self._constants = free, *joints, links, root, first, chain

    def of(self, pose: Array, velocity: Array, joint_vel: Array, com: Array) -> Array:
        """(N, B, 6) velocities of the bodies' frame origins, and their rates; 0 of what stands still.

        Args:
            pose: (N, B, 7) of all bodies.
            velocity: (N, B, 6) of free bodies' centres of mass, and their rates.
            joint_vel: (N, J).
            com: (N, B, 3) centres of mass in the bodies' frames.
        """
        twists = np.zeros(velocity.shape)
        _twists(pose, velocity, joint_vel, com, *self._constants, twists)
        return twists


@compiled
def _cross(a: tuple[float, float, float], b: tuple[float, float, float]) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def _rotated(pose: Array, v: Array) -> tuple[float, float, float]:
    """A vector of the frame at `pose`, in world axes, in the order of `anysim.math.pose.rotate`."""
    u, w = (pose[3], pose[4], pose[5]), pose[6]
    t = _cross(u, (v[0], v[1], v[2]))
    t = (2.0 * t[0], 2.0 * t[1], 2.0 * t[2])
    c = _cross(u, t)
    return v[0] + w * t[0] + c[0], v[1] + w * t[1] + c[1], v[2] + w * t[2] + c[2]


@compiled
def _twists(
    pose: Array,
    velocity: Array,
    joint_vel: Array,
    com: Array,
    free: Array,
    body: Array,
    axis: Array,
    anchor: Array,
    turns: Array,
    links: Array,
    root: Array,
    first: Array,
    chain: Array,
    out: Array,
) -> None:
    """Write the rows of free bodies and of links into twists (N, B, 6).

    For links: a rigid motion is its angular rate and the velocity of whatever passes the world's origin; both add along
    a chain of joints, from the root on.

    Args:
        pose: (N, B, 7), velocity: (N, B, 6), joint_vel: (N, J), com: (N, B, 3), see `LinkTwists.of`.
        free: (F,) bodies.
        body: (J,), axis: (J, 3), anchor: (J, 3), turns: (J,) 1 of a revolute joint, 0 of a prismatic one.
        links: (K,), root: (K,) bodies; the joints of link k are those of `chain` from `first[k]` to `first[k + 1]`.
        out: the twists, written.
    """
    motion = np.empty((body.shape[0], 6))
    total = np.empty(6)
    for e in range(out.shape[0]):
        for b in free:
            rate = (velocity[e, b, 3], velocity[e, b, 4], velocity[e, b, 5])
            moved = _cross(rate, _rotated(pose[e, b], com[e, b]))
            for k in range(3):
                out[e, b, k], out[e, b, 3 + k] = velocity[e, b, k] - moved[k], rate[k]
        for j in range(body.shape[0]):
            at = pose[e, body[j]]
            speed, turning = joint_vel[e, j], turns[j]
            a = _rotated(at, axis[j])
            a = (a[0] * speed, a[1] * speed, a[2] * speed)
            p = _rotated(at, anchor[j])
            p = (at[0] + p[0], at[1] + p[1], at[2] + p[2])
            r = (a[0] * turning, a[1] * turning, a[2] * turning)
            c = _cross(p, r)
            for k in range(3):
                motion[j, k], motion[j, 3 + k] = c[k] + a[k] * (1.0 - turning), r[k]
        for i in range(links.shape[0]):
            total[:] = 0.0
            for n in range(first[i], first[i + 1]):
                for k in range(6):
                    total[k] += motion[chain[n], k]
            base, at = out[e, root[i]], pose[e, root[i]]
            c = _cross((base[3], base[4], base[5]), (at[0], at[1], at[2]))
            for k in range(3):
                total[k] += base[k] - c[k]
                total[3 + k] += base[3 + k]
            at = pose[e, links[i]]
            c = _cross((total[3], total[4], total[5]), (at[0], at[1], at[2]))
            for k in range(3):
                out[e, links[i], k], out[e, links[i], 3 + k] = total[k] + c[k], total[3 + k]
