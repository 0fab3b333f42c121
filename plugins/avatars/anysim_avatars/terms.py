"""Terms about avatars: what one is doing, and where it is after something."""

from collections.abc import Callable, Mapping
from typing import ClassVar

import numpy as np

from anysim.conventions import Array
from anysim.errors import NameLookupError, listing
from anysim.task.scene import SceneView
from anysim_avatars.family import Avatars


class AvatarView:
    """An avatar of the world. In YAML: its name."""

    reference_kind: ClassVar[str] = "avatar"

    def __init__(self, scene: SceneView, name: str) -> None:
        self.scene = scene
        found = {} if scene.families is None else scene.families.of_kind(Avatars)
        where = {one: (family, number) for family in found for number, one in enumerate(family.names)}
        if name not in where:
            raise NameLookupError(f"there is no avatar '{name}' (avatars: {listing(where) or 'none'})")
        self.family, self.number = where[name]

    def rows(self, key: str) -> Array:
        """(n, …) of its memory."""
        return self.family.memory[key][self.scene.env_ids, self.number]


def doing(scene: SceneView, *, avatar: AvatarView, what: str) -> Array:
    """An avatar plays a clip: idle, walk, sit, talk or another one."""
    return avatar.rows("playing") == avatar.family.clip_number(what)


def reached(scene: SceneView, *, avatar: AvatarView, tolerance: float = 1e-6) -> Array:
    """A palm of an avatar is at what it reaches for, within `tolerance` [m]."""
    return ((avatar.rows("reaching") == 1.0) & (avatar.rows("missed") <= tolerance)).any(axis=1)


def motion(scene: SceneView, *, avatar: AvatarView) -> Array:
    """Place [m], heading [rad] and velocity [m/s] of an avatar on the ground (n, 5)."""
    return np.concatenate([avatar.rows("pos"), avatar.rows("yaw")[:, None], avatar.rows("vel")], axis=-1)


TERMS: Mapping[str, Mapping[str, Callable[..., Array]]] = {
    "observation": {"motion": motion},
    "predicate": {"doing": doing, "reached": reached},
}
