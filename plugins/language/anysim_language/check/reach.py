"""Reach found a second time: sampled postures of an arm, brought nearer by cyclic coordinate descent."""

import numpy as np
from scipy.spatial.transform import Rotation

from anysim.conventions import Array
from anysim.model.world import JointType, Robot
from anysim_language.episode import Episode

SAMPLES, KEPT, SWEEPS = 2000, 12, 60
MISSED = 0.020
"""[m] A place is reached where the tool comes nearer than this."""


def reaches(episode: Episode, step: int, robot: Robot, place: Array) -> bool:
    """Whether a tool of a robot comes to a place (3,) [m] by the joints of its arm alone."""
    return any(
        _nearest(_Arm(episode, step, robot, site), place) < MISSED for site in dict.fromkeys(robot.tools.values())
    )


class _Arm:
    """The links from where the arm begins to a tool: fixed turns and steps, and the joints between them."""

    def __init__(self, episode: Episode, step: int, robot: Robot, site: int) -> None:
        world, poses = episode.world, episode.body_pose[step]
        own = set(robot.channels["arm"].joints)
        links: list[int] = []
        body = world.sites[site].body
        while body >= 0:
            links.insert(0, body)
            body = world.bodies[body].parent
        moved = [k for k, link in enumerate(links) if world.body_joint[link] in own]
        self.steps: list[tuple[Rotation, Array, int]] = []
        """(turn, offset, joint or -1) from body to body, where joints of others stand as they do now."""
        self.joints: list[int] = []
        for link, before in zip(
            links[moved[0] :] if moved else [], links[moved[0] - 1 :] if moved else [], strict=False
        ):
            joint = world.body_joint[link]
            if joint in own:
                frame = world.bodies[link]
                self.steps.append((Rotation.from_quat(frame.quaternion), np.array(frame.position), len(self.joints)))
                self.joints.append(joint)
            else:
                up = Rotation.from_quat(poses[before, 3:]).inv()
                offset = up.apply(poses[link, :3] - poses[before, :3])
                self.steps.append((up * Rotation.from_quat(poses[link, 3:]), offset, -1))
        start = links[moved[0] - 1] if moved else links[0]
        self.origin, self.turn = np.array(poses[start, :3]), Rotation.from_quat(np.array(poses[start, 3:]))
        self.tip = np.array(world.sites[site].position)
        own_joints = [world.joints[j] for j in self.joints]
        self.slides = [joint.type is JointType.PRISMATIC for joint in own_joints]
        self.axis = np.array([joint.axis for joint in own_joints]).reshape(-1, 3)
        self.anchor = np.array([joint.anchor for joint in own_joints]).reshape(-1, 3)
        ends = [
            (max(j.lower, -np.pi), min(j.upper, np.pi)) if not np.isfinite(j.upper) else (j.lower, j.upper)
            for j in own_joints
        ]
        self.low, self.high = np.array(ends).reshape(-1, 2).T

    def place(self, q: Array) -> tuple[Array, Array, Array]:
        """Of postures (n, K): tool places (n, 3), and of each joint (n, K, 3) a point of its axis and its direction."""
        position, turn = (
            np.tile(self.origin, (len(q), 1)),
            Rotation.from_quat(np.tile(self.turn.as_quat(), (len(q), 1))),
        )
        points, ways = np.zeros((*q.shape, 3)), np.zeros((*q.shape, 3))
        for rest, offset, k in self.steps:
            position, turn = position + turn.apply(offset), turn * rest
            if k < 0:
                continue
            points[:, k], ways[:, k] = position + turn.apply(self.anchor[k]), turn.apply(self.axis[k])
            if self.slides[k]:
                position = position + ways[:, k] * q[:, k, None]
            else:
                turned = turn * Rotation.from_rotvec(self.axis[k] * q[:, k, None])
                position, turn = points[:, k] - turned.apply(self.anchor[k]), turned
        return position + turn.apply(self.tip), points, ways


def _nearest(arm: _Arm, place: Array) -> float:
    """How near [m] to a place a tool comes; infinite for a tool that no joint moves."""
    if not arm.joints:
        return np.inf
    q = np.random.default_rng(0).uniform(arm.low, arm.high, (SAMPLES, len(arm.low)))
    q = q[np.argsort(np.linalg.norm(arm.place(q)[0] - place, axis=1))[:KEPT]]
    for _ in range(SWEEPS):
        tool, points, ways = arm.place(q)
        if np.linalg.norm(tool - place, axis=1).min() < MISSED / 2.0:
            break
        for k in reversed(range(len(arm.joints))):  # what is nearer to the tool has moved, what is before it has not
            way, point = ways[:, k], points[:, k]
            if arm.slides[k]:
                change = ((place - tool) * way).sum(axis=1)
            else:
                held, wanted = (x - (x * way).sum(axis=1)[:, None] * way for x in (tool - point, place - point))
                change = np.arctan2((np.cross(held, wanted) * way).sum(axis=1), (held * wanted).sum(axis=1))
            before = q[:, k].copy()
            q[:, k] = np.clip(before + change, arm.low[k], arm.high[k])
            moved = way * (q[:, k] - before)[:, None]
            tool = tool + moved if arm.slides[k] else point + Rotation.from_rotvec(moved).apply(tool - point)
    return float(np.linalg.norm(arm.place(q)[0] - place, axis=1).min())
