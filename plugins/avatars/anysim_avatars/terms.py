"""Terms about avatars: what one is doing, and where it is after something."""

from collections.abc import Callable, Mapping
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import NameLookupError, listing
from anysim.task.scene import Frame, SceneView
from anysim_avatars.events import StepOut, stroll
from anysim_avatars.hold import GIVEN, HELD, Hold
from anysim_avatars.view import AvatarView


def doing(scene: SceneView, *, avatar: AvatarView, what: str) -> Array:
    """An avatar plays a clip: idle, walk, sit, talk or another one."""
    return avatar.rows("playing") == avatar.family.clip_number(what)


def reached(scene: SceneView, *, avatar: AvatarView, tolerance: float = 1e-6) -> Array:
    """A palm of an avatar is at what it reaches for, within `tolerance` [m]."""
    return ((avatar.rows("reaching") == 1.0) & (avatar.rows("missed") <= tolerance)).any(axis=1)


def motion(scene: SceneView, *, avatar: AvatarView) -> Array:
    """Place [m], heading [rad] and velocity [m/s] of an avatar on the ground (n, 5)."""
    return np.concatenate([avatar.rows("pos"), avatar.rows("yaw")[:, None], avatar.rows("vel")], axis=-1)


class HoldView:
    """A hold of the world: a family `avatar_hold`. In YAML: its name."""

    reference_kind: ClassVar[str] = "hold"

    def __init__(self, scene: SceneView, name: str) -> None:
        self.scene = scene
        found = {} if scene.families is None else {one.setting.name: one for one in scene.families.of_kind(Hold)}
        if name not in found:
            raise NameLookupError(f"there is no hold '{name}' (holds: {listing(found) or 'none'})")
        self.family = found[name]

    @property
    def now(self) -> Array:
        """(n,) FREE, HELD or GIVEN."""
        return self.family.holding[self.scene.env_ids]


def holding(scene: SceneView, *, hold: HoldView) -> Array:
    """A hand of an avatar holds its object."""
    return hold.now == HELD


def let_go(scene: SceneView, *, hold: HoldView) -> Array:
    """A hand of an avatar has let go of what was pulled out of it."""
    return hold.now == GIVEN


def gap(scene: SceneView, *, avatar: AvatarView, frame: Frame) -> Array:
    """How far a frame's origin is from the surface of an avatar's limbs [m]; negative inside of them."""
    return avatar.gap(frame.position)[:, None]


def within(
    scene: SceneView, *, avatar: AvatarView, frame: Frame, distance: Annotated[float, Field(gt=0, description="[m]")]
) -> Array:
    """A frame's origin is nearer than `distance` to the surface of an avatar's limbs."""
    return avatar.gap(frame.position) < distance


TERMS: Mapping[str, Mapping[str, Callable[..., object]]] = {
    "observation": {"motion": motion, "gap": gap},
    "predicate": {"doing": doing, "reached": reached, "holding": holding, "let_go": let_go, "within": within},
    "event": {"step_out": StepOut, "stroll": stroll},
}
