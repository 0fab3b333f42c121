"""The gripper that grasps are tried with: a palm and two fingers that slide, without an arm."""

from dataclasses import dataclass, replace
from math import inf

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.assets.procedural import build
from anysim.conventions import Array
from anysim.errors import AssetError
from anysim.math import pose as P
from anysim.model.hash import FORMAT, world_hash
from anysim.model.world import Box, JointType, World

TOOL = "tcp"
"""The frame of a gripper between its pads: z out of the hand, y along the opening."""
SPARE = 0.004
"""[m] by which open fingers are wider than what they are put around."""
FORCE = 20.0
"""[N] of each finger where the builder says nothing."""
ARMATURE = 0.1
"""[kg] the drive seen at a finger: the 50 g of a bare finger make contact numerically hopeless."""


@dataclass(frozen=True)
class Gripper:
    """A parallel gripper.

    Attributes:
        name: its builder with the parameters that were given, such as `parallel_gripper:stroke=0.1`.
        model: with armature and force at its fingers.
        tool: (7,) the tool's frame in the root's.
        stroke: how far the pads are apart when open [m].
        force: of each finger [N].
        boxes: poses (K, 7) in the tool's frame and half sizes (K, 3) of its parts with open fingers.
        hash: a digest of all this.
    """

    name: str
    model: ImportedModel
    tool: Array
    stroke: float
    force: float
    boxes: tuple[Array, Array]
    hash: str

    @property
    def max_width(self) -> float:
        """What it can be put around [m]."""
        return self.stroke - SPARE


def gripper(name: str = "parallel_gripper") -> Gripper:
    """A procedural gripper by name, with parameters after a colon: `parallel_gripper:stroke=0.1,force=40`.

    Raises:
        AssetError: a parameter is no number, or the asset is no gripper with two sliding fingers and a frame `tcp`.
        PluginError, SpecError: there is no such asset, or a parameter is wrong.
    """
    builder, _, text = name.partition(":")
    params: dict[str, float] = {}
    for part in filter(None, text.split(",")):
        key, _, value = part.partition("=")
        try:
            params[key] = float(value)
        except ValueError:
            raise AssetError(f"the gripper '{name}': '{part}' is not KEY=NUMBER, such as stroke=0.1") from None
    model = build(builder, params)
    sites = {site.name: site for site in model.sites}
    sliding = [joint.type for joint in model.joints] == [JointType.PRISMATIC] * 2
    if not sliding or TOOL not in sites or not all(isinstance(g.shape, Box) for g in model.geoms if g.collides):
        raise AssetError(
            f"'{builder}' is no parallel gripper: two sliding fingers, parts that are boxes, a frame '{TOOL}'"
        )
    force = FORCE if model.joints[0].effort_limit == inf else model.joints[0].effort_limit
    joints = tuple(
        replace(j, armature=max(j.armature, ARMATURE), effort_limit=force, initial=j.upper) for j in model.joints
    )
    model = replace(model, joints=joints, affordances=())
    site = sites[TOOL]
    tool = np.array([*site.position, *site.quaternion])
    digest = world_hash(World(FORMAT, bodies=model.bodies, joints=joints, geoms=model.geoms, sites=model.sites))
    stroke = sum(joint.upper for joint in joints)
    return Gripper(name, model, tool, stroke, force, _boxes(model, tool), digest)


def _boxes(model: ImportedModel, tool: Array) -> tuple[Array, Array]:
    open_at = {0: np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])}
    for joint in model.joints:
        body = model.bodies[joint.body]
        at = np.array([*body.position, *body.quaternion])
        at[:3] += P.rotate(at[3:], np.array(joint.axis) * joint.upper)
        open_at[joint.body] = at
    solid = [g for g in model.geoms if g.collides]
    poses = [P.compose(open_at[g.body], np.array([*g.position, *g.quaternion])) for g in solid]
    halves = [g.shape.half_size for g in solid if isinstance(g.shape, Box)]
    return P.compose(P.inverse(tool), np.stack(poses)), np.array(halves)
