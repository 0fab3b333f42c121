"""Points that bases drive to: where each segment took them, on the ground and in the image."""

from collections.abc import Mapping, Sequence
from typing import Annotated

import numpy as np
from pydantic import Field as Checked

from anysim.math import pose as P
from anysim.model.world import EntityKind
from anysim_annotation.api import Field, Record, SegmentAnnotator
from anysim_annotation.targets import robot_of
from anysim_annotation.view import Scene, Segment


class NavPoint(SegmentAnnotator):
    """Of each skill segment in which the root of a robot came further than `least`."""

    by = "skill"
    records: Mapping[str, Field] = {
        "robot": Field((), "name"),
        "point": Field((3,), "m", "", "below the robot's root at the end, on the ground, world frame"),
        "yaw": Field((), "rad", "", "of the root then"),
        "start": Field((3,), "m", "", "the same at the beginning"),
        "pixel": Field((2,), "px", "", "the point in the image of the segment's first step"),
        "depth": Field((), "m", "", "of the point along the optical axis then"),
        "inside": Field((), "1", "", "whether it is within that image"),
    }

    def __init__(self, scene: Scene, *, least: Annotated[float, Checked(gt=0, description="[m]")] = 0.05) -> None:
        super().__init__(scene)
        self._least = least

    def label(self, segment: Segment) -> Sequence[Record]:
        world, found = self.scene.world, list[Record]()
        robots = {entity.name: entity.root for entity in world.entities if entity.kind is EntityKind.ROBOT}
        for name in robot_of(segment.params, tuple(robots)):
            body = self._carrier(robots[name], segment)
            begun, ended = (view.body_pose[0, body] for view in (segment.first, segment.last))
            if np.linalg.norm(ended[:2] - begun[:2]) < self._least:
                continue
            start, point = (np.append(p[:2], self._height(p)) for p in (begun, ended))
            seen = segment.first.project(point[None, None])
            ahead = P.rotate(ended[3:], np.array([1.0, 0.0, 0.0]))
            found.append(
                {
                    "robot": name,
                    "point": point,
                    "yaw": float(np.arctan2(ahead[1], ahead[0])),
                    "start": start,
                    "pixel": seen.pixel[0, 0],
                    "depth": float(seen.depth[0, 0]),
                    "inside": bool(seen.inside[0, 0]),
                }
            )
        return found

    def _carrier(self, root: int, segment: Segment) -> int:
        """The root, or of a base that moves on joints of its own the first body after them."""
        world, body = self.scene.world, root
        columns = [world.robots[i].channels.get("base") for i, r in enumerate(world.robots)]
        joints = {joint for channel in columns if channel is not None for joint in channel.joints}
        for child in range(root + 1, len(world.bodies)):
            moved = world.body_joint[child] in joints and world.bodies[child].parent == body
            if (
                moved
                and np.linalg.norm(segment.last.body_pose[0, child, :2] - segment.first.body_pose[0, child, :2]) > 0
            ):
                body = child
        return body

    def _height(self, pose: np.ndarray) -> float:
        below = float(np.asarray(self.scene.world.ground.heights_at(pose[None, :2])).reshape(-1)[0])
        return below if np.isfinite(below) else 0.0
