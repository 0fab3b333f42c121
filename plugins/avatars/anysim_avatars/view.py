"""The view of an avatar that terms take by its name."""

from typing import ClassVar

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

    def gap(self, points: Array) -> Array:
        """(n,) [m] from points (n, 3) to the nearest of its capsules."""
        return self.family.gap(self.scene.state.body_pose[self.scene.env_ids], self.number, points)
