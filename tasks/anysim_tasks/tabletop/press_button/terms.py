"""Terms of this task that no other needs."""

from collections.abc import Callable

import numpy as np

from anysim.conventions import Array
from anysim.math.pose import rotate
from anysim.task.contract import changes_nothing_seen
from anysim.task.joints import JointView
from anysim.task.scene import SceneView
from anysim_schemas.base import NonNegative

Draw = Callable[..., Array]


@changes_nothing_seen
def return_force(scene: SceneView, draw: Draw, *, joint: JointView, force: NonNegative) -> None:
    """For `when: step`: a force [N] on the link of a slide towards where its joint is at zero, as of a long spring."""
    moved = joint.found[0]
    turn = scene.state.body_pose[scene.rows, moved.body, 3:]
    wrench = np.zeros((len(turn), 1, 6))
    wrench[:, 0, :3] = rotate(turn, np.broadcast_to(-force * np.array(moved.axis), (len(turn), 3)))
    scene.engine.apply_wrench(wrench, [moved.body], scene.env_ids)


TERMS = {"event": {"return_force": return_force}}
