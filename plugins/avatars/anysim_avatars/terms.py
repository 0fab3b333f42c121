"""Terms about avatars: what one is doing, and where it is after something."""

from collections.abc import Callable, Mapping

import numpy as np

from anysim.conventions import Array
from anysim.task.scene import SceneView
from anysim_avatars.events import StepOut, stroll
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


TERMS: Mapping[str, Mapping[str, Callable[..., object]]] = {
    "observation": {"motion": motion},
    "predicate": {"doing": doing, "reached": reached},
    "event": {"step_out": StepOut, "stroll": stroll},
}
