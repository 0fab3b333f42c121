"""Footprints: where a base can stand, by the boxes of what stands between its lowest and its highest point."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.geometry.bounds import shape_bounds
from anysim.math import pose as P
from anysim.model.shapes import is_ground
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, RobotView

CLEAR = 0.03
"""[m] kept from what stands around."""
LOW = 0.03
"""[m] above the lowest point of a base: what is lower, as the ground, is driven over."""
_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=bool)


class Around(NamedTuple):
    """A base and what stands at its height, as they are now in n envs.

    Attributes:
        low, high: (n, 2) [m] corners of the base's rectangle in its own frame, with room around it.
        things: (n, g, 8, 2) [m] corners of boxes in the world, seen from above.
        there: (n, g) bool: which of them are in the way of something at the base's height.
    """

    low: Array
    high: Array
    things: Array
    there: Array


class Footprint:
    """The rectangle on the ground that a robot covers without its arms, and what it may not overlap.

    Things are taken for the boxes of their collision geometry, so a place that is called free is free.
    """

    def __init__(self, env: TaskEnv, robot: RobotView, frame: Frame, arms: Array) -> None:
        """`frame` is moved over the ground; `arms` are world indices of joints that do not belong to the base."""
        world = env.engine.world
        self._env, self._frame = env, frame
        meshes = {mesh.name: mesh for mesh in world.meshes}
        owner, entity = np.array([*world.body_entity, -1]), world.entity_numbers[robot.name]
        above = {world.joints[j].body for j in arms.tolist()}
        boxes, bodies, entities, own = [], [], [], []
        for geom in world.geoms:
            if not geom.collides or is_ground(geom.shape):
                continue
            body = geom.body
            while body != WORLD and body not in above:
                body = world.bodies[body].parent
            mine = geom.body != WORLD and owner[geom.body] == entity
            if mine and body != WORLD:
                continue  # of an arm
            low, high = shape_bounds(geom.shape, P.pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), meshes)
            corners = np.where(_CORNERS, high, low)
            boxes.append(np.array(geom.position) + P.rotate(np.tile(geom.quaternion, (8, 1)), corners))
            bodies.append(geom.body)
            entities.append(owner[geom.body])
            own.append(mine)
        self._boxes, self._bodies, self._entities = np.array(boxes), np.array(bodies), np.array(entities)
        self._own = np.array(own, dtype=bool)
        begun, at = world.initial_body_pose, env.engine.index.frame(frame.name)
        offset = np.array([*at.position, *at.quaternion])
        height = P.compose(begun[at.body], offset)[2]
        mine = begun[self._bodies[self._own]][:, None]
        corners = mine[..., :3] + P.rotate(np.broadcast_to(mine[..., 3:], (len(mine), 8, 4)), self._boxes[self._own])
        self._lowest = corners[..., 2].min() - height
        """[m] of the base, above the frame, as it begins: later on the boxes of wheels are turned."""

    def look(self, ids: Array, at: Array) -> Around:
        """Where base and boxes are in these envs; `at` are their rows in the scene."""
        points = self._points(ids)
        base = points[:, self._own].reshape(len(ids), -1, 3)
        here = self._frame.pose[at]
        in_frame = P.rotate_inverse(here[:, None, 3:], base - here[:, None, :3])
        low, high = in_frame[..., :2].min(axis=1) - CLEAR, in_frame[..., :2].max(axis=1) + CLEAR  # (n, 2)
        things = points[:, ~self._own]
        bottom, top = here[:, 2] + self._lowest + LOW, base[..., 2].max(axis=1)
        there = self._env.scene.presence[ids][:, self._entities[~self._own]] | (self._entities[~self._own] < 0)
        there &= (things[..., 2].max(axis=2) > bottom[:, None]) & (things[..., 2].min(axis=2) < top[:, None])
        return Around(low, high, things[..., :2], there)

    @classmethod
    def free(cls, around: Around, stands: Array) -> Array:
        """(n, c) bool: the base overlaps nothing at stands (n, c, 3) of x, y [m] and yaw [rad] of its frame."""
        hit = cls._overlap(stands, around.low, around.high, around.things) & around.there[:, None]
        return np.logical_not(hit.any(axis=2))

    def _points(self, ids: Array) -> Array:
        """(n, G, 8, 3) the corners of all boxes in the world."""
        poses = self._env.scene.state.body_pose[ids][:, self._bodies]
        poses[:, self._bodies == WORLD] = P.pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        return poses[:, :, None, :3] + P.rotate(poses[:, :, None, 3:], self._boxes[None])

    @staticmethod
    def _overlap(stands: Array, low: Array, high: Array, things: Array) -> Array:
        """(n, c, g) bool, by separating axes: rectangles low, high (n, 2) at stands, and things (n, g, 8, 2)."""
        cosine, sine = np.cos(stands[..., 2])[..., None, None], np.sin(stands[..., 2])[..., None, None]
        off = things[:, None] - stands[:, :, None, None, :2]
        x, y = cosine * off[..., 0] + sine * off[..., 1], cosine * off[..., 1] - sine * off[..., 0]
        apart = np.zeros(x.shape[:3], dtype=bool)
        for axis, values in enumerate((x, y)):
            apart |= (values.min(axis=3) > high[:, None, None, axis]) | (values.max(axis=3) < low[:, None, None, axis])
        rectangle = np.stack(
            [np.stack([a[:, 0], b[:, 1]], axis=-1) for a, b in ((low, low), (low, high), (high, low), (high, high))],
            axis=1,
        )  # (n, 4, 2)
        turn = stands[..., 2][..., None]
        corners = stands[:, :, None, :2] + np.stack(
            [
                np.cos(turn) * rectangle[:, None, :, 0] - np.sin(turn) * rectangle[:, None, :, 1],
                np.sin(turn) * rectangle[:, None, :, 0] + np.cos(turn) * rectangle[:, None, :, 1],
            ],
            axis=-1,
        )  # (n, c, 4, 2)
        for k in (1, 2, 4):  # edges of the boxes
            normal = things[:, :, k] - things[:, :, 0]
            normal = np.stack([-normal[..., 1], normal[..., 0]], axis=-1)
            mine = np.einsum("ncjd,ngd->ncgj", corners, normal)
            theirs = np.einsum("ngjd,ngd->ngj", things, normal)[:, None]
            apart |= (mine.min(axis=3) > theirs.max(axis=3)) | (mine.max(axis=3) < theirs.min(axis=3))
        return ~apart
