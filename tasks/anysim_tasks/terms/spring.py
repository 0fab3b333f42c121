"""A spring at a joint that turns."""

from collections.abc import Callable
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math.pose import rotate
from anysim.model.world import JointType
from anysim.task.contract import changes_nothing_seen
from anysim.task.joints import JointView
from anysim.task.scene import SceneView

Draw = Callable[..., Array]


@changes_nothing_seen
class Spring:
    """For `when: step`: a spring turns a joint to its rest, and what carries the link feels the opposite torque.

    The torque of a control step is that at its beginning, so the joint needs damping: more than stiffness times control
    step. The first step of an episode has none.
    """

    def __init__(
        self,
        scene: SceneView,
        *,
        joint: JointView,
        stiffness: Annotated[float, Field(gt=0, description="[N m/rad]")],
        rest: Annotated[
            float, Field(description="where it has no torque [rad]; beyond a limit of the joint it is preloaded")
        ],
    ) -> None:
        if len(joint.found) != 1 or joint.found[0].type is not JointType.REVOLUTE:
            raise TaskError(f"'{joint.name}' is not one joint that turns; expected one, of one object")
        self._scene, self._joint, self._stiffness, self._rest = scene, joint, stiffness, rest
        self._axis, self._body = np.array(joint.found[0].axis, dtype=float), joint.found[0].body
        self._carrier = scene.engine.world.bodies[self._body].parent

    def __call__(self, draw: Draw) -> None:
        del draw
        scene = self._scene
        turn = scene.state.body_pose[scene.rows, self._body, 3:]
        axis = rotate(turn, np.broadcast_to(self._axis, (len(turn), 3)))
        wrench = np.zeros((len(turn), 1, 6))
        wrench[:, 0, 3:] = (self._stiffness * (self._rest - self._joint.position))[:, None] * axis
        scene.engine.apply_wrench(wrench, [self._body], scene.env_ids)
        if self._carrier >= 0:
            scene.engine.apply_wrench(-wrench, [self._carrier], scene.env_ids)
