"""Reward terms: `(scene, *, parameters) -> (n,)`; the task multiplies by the weight and adds up."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.joints import RangedJointView
from anysim.task.scene import Frame, SceneView

__all__ = ["action_rate", "distance", "joint_progress", "tanh_distance"]


def distance(scene: SceneView, *, a: Frame, b: Frame) -> Array:
    """Distance of two frames' origins [m]."""
    return P.norm(b.position - a.position)


def tanh_distance(
    scene: SceneView,
    *,
    a: Frame,
    b: Frame,
    scale: Annotated[float, Field(gt=0, description="distance at which the reward has dropped to 0.24 [m]")] = 0.1,
) -> Array:
    """1 - tanh(distance / scale): 1 when the frames coincide, 0 far away."""
    return 1.0 - np.tanh(P.norm(b.position - a.position) / scale)


def joint_progress(
    scene: SceneView,
    *,
    joint: RangedJointView,
    target: Annotated[float, Field(ge=0, le=1, description="share of the range; 0 is closed")] = 1.0,
) -> Array:
    """1 - |opening - target|: 1 where the joint is open as far as wanted, 0 where it is the whole range away."""
    return 1.0 - np.abs(joint.opening - target)


def action_rate(scene: SceneView) -> Array:
    """Sum of the squared action components."""
    action = scene.last_action[scene.rows]
    return P.dot(action, action) if action.shape[1] else np.zeros(len(action))
