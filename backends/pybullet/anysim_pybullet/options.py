"""What can be chosen about PyBullet and means nothing to another engine."""

from pydantic import BaseModel, ConfigDict, Field

from anysim.world.model import Scenery

BACKGROUND = (221 / 255, 230 / 255, 240 / 255)
AMBIENT = 0.35
"""What is drawn where the World says nothing."""


class PybulletOptions(BaseModel):
    """Options of the engine `pybullet`, as in `engine: {name: pybullet, options: {iterations: 100}}`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    iterations: int = Field(default=50, ge=1, description="most sweeps of the constraint solver in a step")
    residual: float = Field(default=1e-7, ge=0, description="velocity residual at which the constraint solver stops")
    contact_erp: float = Field(default=0.1, ge=0, le=1, description="share of a penetration that a step takes back")
    joint_erp: float = Field(default=0.2, ge=0, le=1, description="share of a limit's error that a step takes back")
    shadows: bool = Field(default=False, description="cast shadows in images; twice the time")

    def trajectory_stamp(self) -> str:
        """The options that change trajectories, where they differ from the defaults; else an empty string."""
        defaults = type(self)()
        changed = [
            f"{name}={getattr(self, name)}"
            for name in ("iterations", "residual", "contact_erp", "joint_erp")
            if getattr(self, name) != getattr(defaults, name)
        ]
        return ",".join(changed)


def own_scenery(options: PybulletOptions) -> Scenery:
    """What is drawn where the World says nothing."""
    return Scenery(BACKGROUND, (AMBIENT, AMBIENT, AMBIENT), options.shadows)
