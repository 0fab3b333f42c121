"""One joint of an object or a robot, as terms see it."""

from typing import ClassVar

import numpy as np

from anysim.compile.joints import ends
from anysim.controllers.base import columns
from anysim.conventions import Array
from anysim.errors import NameLookupError, listing, suggest
from anysim.model.world import World
from anysim.task.scene import SceneView


class JointView:
    """A joint of the world. In YAML: `cabinet.drawer_1`.

    The first part may be a slot, whose entities differ between envs: each has to have such a joint. Where none of them
    is there, the joint reads as the world's frame does: at its initial position, at rest.
    """

    reference_kind: ClassVar[str] = "joint"

    def __init__(self, scene: SceneView, name: str) -> None:
        self.scene, self.name = scene, name
        world = scene.engine.world
        joints, self._entities = _find(world, name)
        self._joints = columns(np.array(joints))
        self.found = tuple(world.joints[j] for j in joints)
        """The joint; several only where the reference names a slot."""

    @property
    def position(self) -> Array:
        """(n,) [rad] or [m]."""
        return self._pick(self.scene.state.joint_pos[self.scene.rows][:, self._joints])

    @property
    def velocity(self) -> Array:
        """(n,) [rad/s] or [m/s]."""
        return self._pick(self.scene.state.joint_vel[self.scene.rows][:, self._joints])

    def _pick(self, values: Array) -> Array:
        """Of values (n, K) that of the entity that is there (n,)."""
        if len(self.found) == 1:
            return values[:, 0]
        present = self.scene.engine.presence[self.scene.rows][:, self._entities]
        return values[np.arange(len(values)), np.argmax(present, axis=1)]


class RangedJointView(JointView):
    """A joint that has limits, so that it can be open or closed. In YAML: `cabinet.drawer_1`."""

    reference_kind: ClassVar[str] = "ranged joint"

    def __init__(self, scene: SceneView, name: str) -> None:
        super().__init__(scene, name)
        self._closed, opened = np.array([ends(joint) for joint in self.found], dtype=float).T
        self._span = opened - self._closed
        if not np.isfinite(self._span).all():
            raise NameLookupError(
                f"the joint '{name}' has no limits, so it is neither open nor closed; ask for its position, as "
                "`joint_above` does, or give it `limits`"
            )

    @property
    def opening(self) -> Array:
        """(n,) how far it is open: 0 at the limit that is nearer to zero, 1 at the other."""
        position = self.scene.state.joint_pos[self.scene.rows][:, self._joints]
        return self._pick((position - self._closed) / self._span)


def _find(world: World, name: str) -> tuple[list[int], list[int]]:
    """The joints that a reference stands for, and the entities that have them."""
    joints = {joint.name: i for i, joint in enumerate(world.joints)}
    owner, _, local = name.partition(".")
    slot = next((slot for slot in world.slots if slot.name == owner), None)
    entities = {entity.name: i for i, entity in enumerate(world.entities)}
    members = [entities[owner]] if slot is None and owner in entities else list(slot.entities if slot else ())
    if not members:
        raise NameLookupError(
            f"there is no robot or object '{owner}'{suggest(owner, list(entities))} (entities: {listing(entities)})"
        )
    names = [f"{world.entities[e].name}.{local}" for e in members]
    for full, entity in zip(names, members, strict=True):
        if full not in joints:
            its = world.entities[entity]
            own = world.joints[its.joint_start : its.joint_stop]
            known = [joint.name.removeprefix(f"{its.name}.") for joint in own]
            raise NameLookupError(
                f"'{its.name}' has no joint '{local}'{suggest(local, known)} (joints: {listing(known, 20)})"
            )
    return [joints[full] for full in names], members
