"""Mimic joints as fixed tendons of a library that joins neighbouring links by one."""

from typing import NamedTuple

from anysim.errors import EngineError
from anysim.model.world import World


class MimicTendon(NamedTuple):
    """A fixed tendon: links, a coefficient for the joint of each, and what their weighted sum is held at."""

    links: list[int]
    coefficients: list[float]
    rest: float


def tendon_of(world: World, follower: int) -> MimicTendon:
    """The tendon that holds `follower - multiplier * leader` at the offset of its mimic.

    Where the leader is out of a tendon's reach, another joint that follows the same leader stands for it.

    Raises:
        EngineError: neither moves a link that is a neighbour of the follower's or has the same parent.
    """
    joint = world.joints[follower]
    assert joint.mimic is not None
    leader, multiplier, offset, _ = joint.mimic
    guides = [(leader, multiplier, offset)]
    for index, other in enumerate(world.joints):
        if index != follower and other.mimic is not None and other.mimic.joint == leader and other.mimic.multiplier:
            ratio = multiplier / other.mimic.multiplier
            guides.append((index, ratio, offset - ratio * other.mimic.offset))
    parent = world.bodies[joint.body].parent
    for index, ratio, rest in guides:
        guide = world.joints[index].body
        above = world.bodies[guide].parent
        if parent in (above, guide):
            return MimicTendon([above, guide, joint.body], [0.0, -ratio, 1.0], rest)
    raise EngineError(
        f"SAPIEN cannot make joint '{joint.name}' follow '{world.joints[leader].name}': a tendon joins links with one "
        f"parent, or a link and its child; drive the joint itself, or use another engine"
    )
