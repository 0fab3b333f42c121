"""A gait by the clock: which feet shall stand and which swing, for robots whose catalogue entry names their legs."""

from typing import Annotated, ClassVar
from weakref import WeakKeyDictionary

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.task.contract import at_most
from anysim.task.scene import RobotView, SceneView

TOUCH = 0.005
"""A foot that is less than this above the ground stands on it [m]."""

Frequency = Annotated[float, Field(gt=0, description="strides a second [1/s]")]
Duty = Annotated[float, Field(ge=0.5, lt=1, description="share of a stride that a foot stands")]

_ROSE = np.stack([np.cos(np.arange(8) * np.pi / 4), np.sin(np.arange(8) * np.pi / 4)], axis=1)


class Feet:
    """The feet of a robot, in the order of its legs.

    Attributes:
        height: of the base over the ground at home [m], by which the robot's size is told.
        offset: (L,) of each foot's phase: diagonal legs step together, and the two of a biped in turn.
    """

    _shared: ClassVar[WeakKeyDictionary[SceneView, dict[str, "Feet"]]] = WeakKeyDictionary()

    def __init__(self, scene: SceneView, robot: RobotView) -> None:
        world, entry = scene.engine.world, robot.model.entry
        if entry is None or not entry.legs:
            raise TaskError(
                f"'{robot.name}' ({robot.model.model}) has no `legs` in the catalogue; name a robot with legs"
            )
        frames = [scene.index.frame(f"{robot.name}.{leg.foot}") for leg in entry.legs.values()]
        self._scene, self.height, self._moment = scene, float(entry.base_height), -1
        self._bodies = np.array([frame.body for frame in frames])
        self._local = np.array([frame.position for frame in frames])
        self._below = np.array([leg.radius + leg.sole_height for leg in entry.legs.values()])
        home = world.initial_body_pose
        root = home[scene.index.entity(robot.name).root]
        place = home[self._bodies, :3] + P.rotate(home[self._bodies, 3:], self._local) - root[:3]
        place = P.rotate_inverse(np.broadcast_to(root[3:], (len(place), 4)), place)
        front = np.where(place[:, 0] >= place[:, 0].mean(), 1.0, -1.0) if len(place) > 2 else np.ones(len(place))
        self.offset = np.where(place[:, 1] * front > 0.0, 0.0, 0.5)

    @classmethod
    def of(cls, scene: SceneView, robot: RobotView) -> "Feet":
        """Those of a robot: made once for all terms that ask.

        Raises:
            TaskError: the catalogue names no legs of it.
        """
        made = cls._shared.setdefault(scene, {})
        if robot.name not in made:
            made[robot.name] = cls(scene, robot)
        return made[robot.name]

    def _see(self) -> None:
        pose = self._scene.state.body_pose[self._scene.rows][:, self._bodies]
        self._arm = P.rotate(pose[..., 3:], np.broadcast_to(self._local, pose[..., :3].shape))
        at = pose[..., :3] + self._arm
        self._at, self._ground = at, self._heights(at)
        self._above, self._moment = at[..., 2] - self._below - self._ground, self._scene.moment

    def _heights(self, at: Array) -> Array:
        return np.nan_to_num(self._scene.engine.world.ground.heights_at(at))

    @property
    def above(self) -> Array:
        """(n, L) how far each foot is above the ground [m]."""
        if self._moment != self._scene.moment:
            self._see()
        return self._above

    @property
    def ground(self) -> Array:
        """(n, L) the height of the ground under each foot [m]."""
        if self._moment != self._scene.moment:
            self._see()
        return self._ground

    def rise(self, reach: float) -> Array:
        """(n, L) by how much the ground is higher at most in eight places `reach` [m] from each foot."""
        ground = self.ground
        return np.maximum(self._heights(self._at[..., None, :2] + reach * _ROSE).max(axis=2) - ground, 0.0)

    @property
    def speed(self) -> Array:
        """(n, L) how fast each foot moves along the ground [m/s]."""
        if self._moment != self._scene.moment:
            self._see()
        twist = self._scene.state.body_twist[self._scene.rows][:, self._bodies]
        return P.norm((twist[..., :3] + P.cross(twist[..., 3:], self._arm))[..., :2])

    def phase(self, frequency: float) -> Array:
        """(n, L) the share of the stride that is behind each foot, which begins with its stance."""
        return (_turns(self._scene, frequency)[:, None] + self.offset) % 1.0


def _turns(scene: SceneView, frequency: float) -> Array:
    """(n,) strides since the episode began."""
    return scene.elapsed[scene.rows] * (scene.engine.world.physics.control_dt * frequency)


def clock(scene: SceneView, *, frequency: Frequency) -> Array:
    """Sine and cosine of the phase of a stride that the episode's beginning began."""
    turn = 2.0 * np.pi * _turns(scene, frequency)
    return np.stack([np.sin(turn), np.cos(turn)], axis=1)


@at_most(1.0)
def gait_contact(scene: SceneView, *, robot: RobotView, frequency: Frequency, duty: Duty = 0.55) -> Array:
    """Share of the feet that stand or swing as the clock of a trot, or of a biped's walk, says."""
    feet = Feet.of(scene, robot)
    return ((feet.above < TOUCH) == (feet.phase(frequency) < duty)).mean(axis=1)


def swing_height_l2(
    scene: SceneView,
    *,
    robot: RobotView,
    frequency: Frequency,
    duty: Duty = 0.55,
    clearance: Annotated[float, Field(gt=0, description="highest, as a share of the base's height at home")] = 0.2,
    around: Annotated[float, Field(ge=0, description="it is to clear ground as far from it, too [m]")] = 0.0,
) -> Array:
    """Squared error of how high swinging feet are, as shares of the base's height at home, summed up.

    A foot is to rise and come down once while the clock lets it swing, and `around` it clears what is higher, too.
    """
    feet = Feet.of(scene, robot)
    swung = (feet.phase(frequency) - duty) / (1.0 - duty)
    highest = clearance + feet.rise(around) / feet.height if around else clearance
    wanted = 0.5 * highest * (1.0 - np.cos(2.0 * np.pi * swung))
    return (((feet.above / feet.height - wanted) ** 2) * (swung > 0.0)).sum(axis=1)


def feet_slide(scene: SceneView, *, robot: RobotView) -> Array:
    """Sum of the squared speeds of feet that stand on the ground [m²/s²]."""
    feet = Feet.of(scene, robot)
    return ((feet.speed**2) * (feet.above < TOUCH)).sum(axis=1)
