"""Options of PyBullet that mean nothing to another engine."""

from typing import ClassVar

from pydantic import Field

from anysim.engine.options import EngineOptions
from anysim.model.world import Scenery, World

BACKGROUND = (221 / 255, 230 / 255, 240 / 255)
AMBIENT = 0.35
"""What is drawn where the World says nothing."""


class PybulletOptions(EngineOptions):
    """Options of the engine `pybullet`, as in `engine: {name: pybullet, options: {iterations: 100}}`."""

    shaping: ClassVar[tuple[str, ...]] = ("iterations", "residual", "contact_erp", "joint_erp")

    iterations: int | None = Field(
        default=None,
        ge=1,
        description="most sweeps of the constraint solver in a step; 50 where not given, "
        "100 where more than two joints of a robot or object follow others",
    )
    residual: float = Field(default=1e-7, ge=0, description="velocity residual at which the constraint solver stops")
    contact_erp: float = Field(default=0.1, ge=0, le=1, description="share of a penetration that a step takes back")
    joint_erp: float = Field(default=0.2, ge=0, le=1, description="share of a limit's error that a step takes back")
    shadows: bool = Field(default=False, description="cast shadows in images; twice the time")


def sweeps(options: PybulletOptions, world: World) -> int:
    """The most sweeps of the constraint solver in a step.

    A sweep goes from coupling to coupling once. The five couplings of a finger linkage of 20 g links on an arm are not
    met in 50: they shook at 10 rad/s; 75 were enough.
    """
    if options.iterations is not None:
        return options.iterations
    joints = [world.joints[entity.joint_start : entity.joint_stop] for entity in world.entities]
    followers = max((sum(joint.mimic is not None for joint in some) for some in joints), default=0)
    return 50 if followers <= 2 else 100


def own_scenery(options: PybulletOptions) -> Scenery:
    """What is drawn where the World says nothing."""
    return Scenery(BACKGROUND, (AMBIENT, AMBIENT, AMBIENT), options.shadows)
