"""The puppet: joints and links of avatars from their feet, hips, posture, gaze and reach."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim_avatars import clips, frames
from anysim_avatars.bodies import Proportions, lengths
from anysim_avatars.gait import Gait

_UP = np.array([0.0, 0.0, 1.0])
GAZE_YAW, GAZE_PITCH = 1.3, 0.8
"""[rad] that a head turns against the trunk."""


class Sizes(NamedTuple):
    """Lengths of the avatars at hand (m,) [m], of BONES (m, 15), and `arm`, shoulder to palm."""

    bones: Array
    hip: Array
    shoulder: Array
    ankle: Array
    arm: Array

    @classmethod
    def of(cls, people: list[Proportions], envs: int) -> "Sizes":
        """Of the same avatars in several envs."""
        each = [[getattr(p, key) for p in people] for key in ("hip", "shoulder", "ankle", "arm")]
        return cls(np.tile([lengths(p) for p in people], (envs, 1)), *(np.tile(values, envs) for values in each))


class Aim(NamedTuple):
    """What the upper body is after.

    Attributes:
        posture: (m, 13) of the clips.
        bend: (m,) [rad] beside the posture's lean.
        gaze: (m, 3) the point looked at; gazing: (m,) share of it in where the head turns.
        reach: (m, 2, 3) the points that the palms are put to; reaching: (m, 2) share of them.
    """

    posture: Array
    bend: Array
    gaze: Array
    gazing: Array
    reach: Array
    reaching: Array


class Figure(NamedTuple):
    """Where everything is.

    Attributes:
        start, end: (m, 15, 3) of the bones; what they join is in the order of BONES.
        rotation: (m, 15, 3, 3) of the links, z along the bone.
        eye: (m, 3); looks: (m, 3) the direction of the gaze.
        missed: (m, 2) [m] by which a palm stays away from its point.
    """

    start: Array
    end: Array
    rotation: Array
    eye: Array
    looks: Array
    missed: Array

    @property
    def poses(self) -> Array:
        """(m, 15, 7) of the links: the middle of each bone; of the head its joint."""
        middle = 0.5 * (self.start + self.end)
        middle[:, 2] = self.start[:, 2]
        return np.concatenate([middle, frames.quaternions(self.rotation)], axis=-1)


def figure(gait: Gait, sizes: Sizes, aim: Aim, head: Array | None = None) -> Figure:
    """The figure of each avatar; `head` (m, 2), yaw and pitch against the trunk, replaces what the aim would give."""
    rows, posture = len(gait.pos), aim.posture
    zero = np.zeros(rows)
    level = frames.turned(gait.yaw, zero)
    forward, left = level[..., 0], level[..., 1]
    start, end = np.zeros((rows, 15, 3)), np.zeros((rows, 15, 3))
    turn = np.zeros((rows, 15, 3, 3))
    hips = np.concatenate([gait.pos, gait.hips[:, None]], axis=-1) - posture[:, clips.BACK, None] * forward
    start[:, 0] = hips
    end[:, 0] = hips + sizes.bones[:, 0, None] * np.array([0.0, 0.0, 1.0])
    turn[:, 0] = level
    trunk = frames.turned(gait.yaw + posture[:, clips.TWIST], posture[:, clips.LEAN] + aim.bend, posture[:, clips.ROLL])
    start[:, 1] = end[:, 0]
    end[:, 1] = neck = start[:, 1] + sizes.bones[:, 1, None] * trunk[..., 2]
    turn[:, 1] = trunk
    turned = head if head is not None else gaze_angles(neck, trunk, sizes, aim)
    skull = trunk @ frames.turned(turned[:, 0], turned[:, 1])
    start[:, 2], end[:, 2], turn[:, 2] = neck, neck + sizes.bones[:, 2, None] * skull[..., 2], skull
    missed = np.zeros((rows, 2))
    for side, sign in ((0, 1.0), (1, -1.0)):
        shoulder = neck + frames.apply(trunk, np.stack([zero, sign * sizes.shoulder, zero - 0.03], axis=-1))
        held = posture[:, clips.LEFT if side == 0 else clips.RIGHT]
        palm = shoulder + sizes.arm[:, None] * frames.apply(trunk, held)
        share = aim.reaching[:, side, None]
        wanted = np.where(share == 1.0, aim.reach[:, side], palm + share * (aim.reach[:, side] - palm))
        pole = frames.apply(trunk, np.array([-0.7, sign * 0.5, -0.55]))
        upper, lower = sizes.bones[:, 3 + side], sizes.bones[:, 5 + side] + 0.5 * sizes.bones[:, 7 + side]
        elbow, reached, missed[:, side] = frames.limb(shoulder, wanted, upper, lower, pole)
        along = (reached - elbow) / lower[:, None]
        wrist = elbow + sizes.bones[:, 5 + side, None] * along
        tip = wrist + sizes.bones[:, 7 + side, None] * along
        hinge = frames.unit(P.cross(elbow - shoulder, reached - elbow) + 1e-9 * left)
        palm_up = hinge + share * (frames.unit(P.cross(along, _UP + zero[:, None]) + 1e-9 * hinge) - hinge)
        for bone, a, b, beside in ((3, shoulder, elbow, hinge), (5, elbow, wrist, palm_up), (7, wrist, tip, palm_up)):
            start[:, bone + side], end[:, bone + side] = a, b
            turn[:, bone + side] = frames.along(b - a, beside)
        hip = hips + (sign * sizes.hip)[:, None] * left
        foot, heading = gait.feet[:, side], gait.feet[:, side, 3]
        ankle = foot[:, :3] + sizes.ankle[:, None] * np.array([0.0, 0.0, 1.0])
        ahead = np.stack([np.cos(heading), np.sin(heading), zero], axis=-1)
        knee, ankle, _ = frames.limb(hip, ankle, sizes.bones[:, 9 + side], sizes.bones[:, 11 + side], forward + ahead)
        sideways = frames.unit(P.cross(_UP + zero[:, None], forward + ahead))
        sole = foot[:, :3] + np.array([0.0, 0.0, 0.042])
        heel, toe = sole - 0.28 * sizes.bones[:, 13, None] * ahead, sole + 0.72 * sizes.bones[:, 13, None] * ahead
        for bone, a, b in ((9, hip, knee), (11, knee, ankle), (13, heel, toe)):
            start[:, bone + side], end[:, bone + side] = a, b
            turn[:, bone + side] = frames.along(b - a, P.cross(_UP + zero[:, None], ahead) if bone == 13 else sideways)
    eye = neck + frames.apply(skull, np.stack([zero + 0.09, zero, sizes.bones[:, 2]], axis=-1))
    return Figure(start, end, turn, eye, skull[..., 0], missed)


def gaze_angles(neck: Array, trunk: Array, sizes: Sizes, aim: Aim) -> Array:
    """(m, 2) yaw and pitch of heads against their trunks: of the posture, of the gaze, or between."""
    held = aim.posture[:, [clips.LOOK_YAW, clips.LOOK_PITCH]]
    if not aim.gazing.any():
        return held
    target = ((aim.gaze - neck)[:, None] @ trunk)[:, 0]  # in the trunk's axes
    angles = np.zeros_like(held)
    for _ in range(12):  # the eye moves with the head: each pass leaves a tenth of what the last one left
        skull = frames.turned(angles[:, 0], angles[:, 1])
        offset = np.stack([np.full(len(neck), 0.09), np.zeros(len(neck)), sizes.bones[:, 2]], axis=-1)
        line = target - frames.apply(skull, offset)
        flat = np.hypot(line[:, 0], line[:, 1])
        angles = np.stack(
            [
                np.clip(np.arctan2(line[:, 1], line[:, 0]), -GAZE_YAW, GAZE_YAW),
                np.clip(-np.arctan2(line[:, 2], flat), -GAZE_PITCH, GAZE_PITCH),
            ],
            axis=-1,
        )
    return held + aim.gazing[:, None] * (angles - held)


def posed(hips: Array, rotation: Array, sizes: Sizes) -> Figure:
    """The figure of avatars with hips (m, 3) whose links have rotations (m, 15, 3, 3), bones of their own lengths."""
    rows = len(hips)
    start, end = np.zeros((rows, 15, 3)), np.zeros((rows, 15, 3))

    def put(bone: int, at: Array) -> Array:
        start[:, bone] = at
        end[:, bone] = at + sizes.bones[:, bone, None] * rotation[:, bone, :, 2]
        return end[:, bone]

    neck = put(1, put(0, hips))
    put(2, neck)
    zero = np.zeros(rows)
    for side, sign in ((0, 1.0), (1, -1.0)):
        shoulder = neck + frames.apply(rotation[:, 1], np.stack([zero, sign * sizes.shoulder, zero - 0.03], axis=-1))
        put(7 + side, put(5 + side, put(3 + side, shoulder)))
        hip = hips + (sign * sizes.hip)[:, None] * rotation[:, 0, :, 1]
        ankle = put(11 + side, put(9 + side, hip))
        foot, size = rotation[:, 13 + side], sizes.bones[:, 13 + side, None]
        put(13 + side, ankle + (sizes.ankle - 0.042)[:, None] * foot[..., 0] - 0.28 * size * foot[..., 2])
    eye = neck + frames.apply(rotation[:, 2], np.stack([zero + 0.09, zero, sizes.bones[:, 2]], axis=-1))
    return Figure(start, end, rotation, eye, rotation[:, 2, :, 0], np.zeros((rows, 2)))
