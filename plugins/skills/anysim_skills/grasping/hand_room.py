"""Room for a hand: a bank's gripper is smaller than what is around the fingers of many an arm, such as its wrist."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.geometry.convex_parts import Part, PlacedSolid, Solid, boxed, pose_of
from anysim.math import pose as P
from anysim.model.world import Entity, Geom, MeshShape, World
from anysim.placement.clearance import TOUCH, ClearanceQuery
from anysim_skills.arm import Arm

_UPRIGHT = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


def hand_geoms(arm: Arm) -> Iterator[tuple[Geom, Array]]:
    """What collides of a hand as it begins, with the poses (7,) of its bodies in the tool's frame."""
    world, frame = arm.env.engine.world, arm.env.engine.index.frame(arm.tool.name)
    tool = P.compose(world.initial_body_pose[frame.body], np.array([*frame.position, *frame.quaternion]))
    for number in world.carried_by(frame.body):
        to_tool = P.compose(P.inverse(tool), world.initial_body_pose[number])
        yield from ((world.geoms[i], to_tool) for i in world.body_geoms[number] if world.geoms[i].collides)


def beyond_tool(arm: Arm) -> float:
    """[m] how far fingers reach beyond the tool, along its z; 0 where nothing of the hand collides."""
    parts = _parts(arm.env.engine.world, arm)
    return max(0.0, float(_at(parts, _UPRIGHT).high[2])) if parts else 0.0


def has_room(arm: Arm, entity: Entity, body: int, poses: Array, within: float = TOUCH) -> Array:
    """(G,) bool: at tool poses (G, 7) in the frame of a body of an entity the open hand is nowhere inside of that.

    Or no more than `within` [m]. The entity's joints are where they begin.
    """
    world = arm.env.engine.world
    hand, query = _parts(world, arm), ClearanceQuery(world)
    to_root = P.compose(P.inverse(world.initial_body_pose[entity.root]), world.initial_body_pose[body])
    thing = Solid(world, entity).at(pose_of(_UPRIGHT))
    tools = P.compose(np.broadcast_to(to_root, poses.shape), poses)
    return np.array([query.gap(_at(hand, tool), thing, 0.0) > -within for tool in tools], dtype=bool)


def _parts(world: World, arm: Arm) -> list[tuple[Part, Array]]:
    """The hand's parts, each with its pose in the tool's frame."""
    vertices = {mesh.name: mesh.vertices for mesh in world.meshes}
    found: list[tuple[Part, Array]] = []
    for geom, body in hand_geoms(arm):
        pose = P.compose(body, np.array([*geom.position, *geom.quaternion]))
        mesh = vertices[geom.shape.mesh] if isinstance(geom.shape, MeshShape) else None
        found.append((Part(geom.shape, pose_of(pose), geom.body, mesh), pose))
    return found


def _at(hand: list[tuple[Part, Array]], tool: Array) -> PlacedSolid:
    parts = tuple(boxed(part, pose_of(P.compose(tool, pose))) for part, pose in hand)
    low, high = np.min([part.low for part in parts], axis=0), np.max([part.high for part in parts], axis=0)
    corners: Any = tuple(low.tolist()), tuple(high.tolist())
    return PlacedSolid("hand", pose_of(tool), parts, *corners)
