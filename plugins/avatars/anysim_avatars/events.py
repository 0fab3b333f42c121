"""Events of avatars: a walk of drawn legs, and a step into the way of a robot that comes near."""

from collections.abc import Callable
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.task.contract import changes_nothing_seen
from anysim.task.scene import RobotView, SceneView
from anysim_avatars.spec import ActionSpec
from anysim_avatars.view import AvatarView
from anysim_schemas.values import FloatValue

Draw = Callable[..., Array]


@changes_nothing_seen
def stroll(
    scene: SceneView,
    draw: Draw,
    *,
    avatar: AvatarView,
    legs: Annotated[int, Field(ge=1, le=16)] = 4,
    length: Annotated[FloatValue, Field(description="of each leg [m]")] = 1.5,
    turn: Annotated[FloatValue, Field(description="from one leg to the next [rad]")] = 0.0,
    speed: Annotated[FloatValue, Field(description="[m/s]")] = 1.0,
    within: Annotated[float, Field(gt=0, description="each point is at most so far from the middle along x and y [m]")],
    wait: Annotated[float, Field(ge=0, description="before it sets out [s]")] = 1.0,
) -> None:
    """For `when: reset`: an avatar walks so many legs, the first the way that it faces, and stands at their end."""
    yaw, place = avatar.rows("yaw").copy(), avatar.rows("pos") - scene.origin[scene.env_ids, :2]
    points = np.zeros((len(yaw), legs, 2))
    for number in range(legs):
        yaw = yaw + (draw(f"turn_{number}", turn) if number else 0.0)
        along = draw(f"length_{number}", length)[:, None] * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
        place = np.clip(place + along, -within, within)
        points[:, number] = place
    pace = np.clip(draw("speed", speed), 0.1, 2.0)
    for row, env in enumerate(scene.env_ids.tolist()):
        path = tuple((x, y) for x, y in points[row].tolist())
        script = [ActionSpec(clip="idle", seconds=wait), ActionSpec(path=path, speed=float(pace[row]))]
        avatar.family.do(script, np.array([env]), avatar.family.names[avatar.number])


@changes_nothing_seen
class StepOut:
    """For `when: step`: an avatar walks ahead once a robot has come near; it stands there for a while, and walks on."""

    def __init__(
        self,
        scene: SceneView,
        *,
        avatar: AvatarView,
        robot: RobotView,
        near: Annotated[FloatValue, Field(description="from the robot's origin to the place that it walks to [m]")],
        across: Annotated[float, Field(gt=0, description="to that place, the way that it faces [m]")],
        seconds: Annotated[FloatValue, Field(description="that it stands there [s]")] = 2.0,
        further: Annotated[float, Field(description="from there; negative is back [m]")] = 2.0,
        speed: Annotated[float, Field(gt=0, le=2, description="of walking, at most [m/s]")] = 1.2,
    ) -> None:
        self._scene, self._avatar, self._robot = scene, avatar, robot
        self._near, self._across, self._seconds, self._further, self._speed = near, across, seconds, further, speed
        self._update = scene.memory(5)  # 1 as it sets out, 2 afterwards; what was drawn; the place that it walks to

    def __call__(self, draw: Draw) -> None:
        seen = self._update(lambda before, first: self._pass(before, first, draw))
        for row in np.flatnonzero(seen[:, 0] == 1.0).tolist():
            _, _, seconds, x, y = seen[row].tolist()
            yaw, on = float(self._avatar.rows("yaw")[row]), self._further
            script = [
                ActionSpec(go_to=(x, y), speed=self._speed),
                ActionSpec(clip="idle", seconds=seconds),
                ActionSpec(go_to=(x + on * float(np.cos(yaw)), y + on * float(np.sin(yaw))), speed=self._speed),
            ]
            avatar = self._avatar
            avatar.family.do(script, self._scene.env_ids[[row]], avatar.family.names[avatar.number])

    def _pass(self, before: Array, first: Array, draw: Draw) -> Array:
        avatar, yaw = self._avatar, self._avatar.rows("yaw")
        way = self._across * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
        place = avatar.rows("pos") - self._scene.origin[self._scene.env_ids, :2] + way
        begun = np.column_stack([np.zeros(len(yaw)), draw("near", self._near), draw("seconds", self._seconds), place])
        after = np.where(first[:, None], begun, before)
        robot = self._robot.base.position - self._scene.origin[self._scene.env_ids]
        near = np.hypot(*(robot[:, :2] - after[:, 3:]).T) < after[:, 1]
        after[:, 0] = np.where(after[:, 0] > 0.0, 2.0, np.where(near, 1.0, 0.0))
        return after
