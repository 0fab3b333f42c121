"""A pose in which legs that are bent at their ends stand below where they begin."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.conventions import Array
from anysim.kinematics.pinocchio_model import RobotModel
from anysim_robots.drafting.guess import Leg, alone

LEAST = 0.02
"""[m] that a foot has to come nearer, so that a joint is moved for it."""
REACH = 1.6
"""[rad] that is tried to both sides of zero."""
TRIED = 161


def stood(model: ImportedModel, legs: Sequence[Leg]) -> tuple[ImportedModel, str]:
    """The model with each foot below the joint above its knee, and what was done; as it is where that gains nothing.

    Files have legs stretched out or, where zero is no position of a knee, bent to one side: such a robot falls over.
    """
    if len(legs) < 4:
        return model, ""
    robot = RobotModel(alone(model, False), "robot")
    q = robot.initial
    number = {name: i for i, name in enumerate(robot.joint_names)}
    limits = {joint.name: joint for joint in model.joints}
    bodies = {joint.name: model.bodies[joint.body].name for joint in model.joints}
    chosen: dict[str, float] = {}
    for leg in legs:
        if len(leg.joints) < 2:
            continue
        mover = leg.joints[-2]
        lower, upper = max(limits[mover].lower, -REACH), min(limits[mover].upper, REACH)
        values = np.linspace(lower, upper, TRIED)
        off = [_off(robot, _with(q, number[mover], value), bodies[mover], leg.foot) for value in values]
        now, best = _off(robot, q, bodies[mover], leg.foot), int(np.argmin(off))
        if now - off[best] > LEAST:
            chosen[mover] = round(float(np.clip(values[best], lower, upper)), 3)
    joints = tuple(
        replace(joint, initial=min(max(chosen[joint.name], joint.lower), joint.upper))
        if joint.name in chosen
        else joint
        for joint in model.joints
    )
    told = f"home: {', '.join(chosen)} put the feet below them" if chosen else ""
    return replace(model, joints=joints), told


def _with(q: Array, joint: int, value: float) -> Array:
    moved = q.copy()
    moved[joint] = value
    return moved


def _off(robot: RobotModel, q: Array, body: str, foot: str) -> float:
    """[m] horizontally from the foot to the origin of a body."""
    whole = robot.q(q)
    place = [robot.frame_pose(whole, robot.frames[name])[:2] for name in (body, foot)]
    return float(np.hypot(*(place[1] - place[0])))
