"""Points and orientations at which things were acted on: for each move of a skill, where its tool was sent."""

from collections.abc import Mapping, Sequence
from typing import Annotated

import numpy as np
from pydantic import Field as Checked

from anysim.conventions import Array
from anysim.math import pose as P
from anysim_annotation.api import Field, Record, SegmentAnnotator
from anysim_annotation.targets import Target, robot_of, target_of
from anysim_annotation.tools import Tool, commanded, placed, tools_of
from anysim_annotation.view import Scene, Segment
from anysim_sensors.scene import WORLD_FRAME


class Affordance(SegmentAnnotator):
    """Of each phase that ends with a tool sent to its target.

    The tool's pose is where the drives were told to bring it in the phase's last step. A ray along its z axis, from
    `reach` before it to `reach` beyond, meets the target's surface at the point; where it misses, the nearest point
    counts if it is within `reach`.
    """

    by = "phase"
    records: Mapping[str, Field] = {
        "tool": Field((), "name"),
        "target": Field((), "name", "", "as the command has it"),
        "point": Field((3,), "m", "", "on the target's surface, world frame"),
        "local": Field((3,), "m", "", "the point in the axes of the target's root"),
        "normal": Field((3,), "1", "", "of the surface there, outward, world frame"),
        "hit": Field((), "1", "", "whether the ray met it; else it is the nearest point"),
        "tool_pose": Field((7,), "m, xyzw", "", "commanded, world frame"),
        "quaternion": Field((4,), "xyzw", "", "the commanded orientation, world frame"),
        "commanded": Field((), "1", "", "false where commands are not known: the pose is that which was reached"),
        "pixel": Field((2,), "px", "", "the point in the image of the segment's last step"),
        "depth": Field((), "m", "", "of the point along the optical axis"),
        "inside": Field((), "1", "", "whether it is within the image"),
    }

    def __init__(self, scene: Scene, *, reach: Annotated[float, Checked(gt=0, le=10, description="[m]")] = 0.1) -> None:
        super().__init__(scene)
        self._reach, self._tools = reach, tools_of(scene.world)

    def label(self, segment: Segment) -> Sequence[Record]:
        target = target_of(segment)
        if target is None:
            return ()
        robots = robot_of(segment.params, tuple(robot.name for robot in self.scene.world.robots))
        found = [self._at(segment, target, tool) for tool in self._tools if tool.robot in robots]
        return [record for record in found if record is not None]

    def _at(self, segment: Segment, target: Target, tool: Tool) -> Record | None:
        view = segment.last
        sent = commanded(tool, view)
        pose = (placed(tool.frame, view.body_pose) if sent is None else sent)[0]
        met = self._met(segment, target, pose)
        if met is None:
            return None
        point, normal, hit = met
        root = view.body_pose[0, self.scene.world.entities[target.entity].root]
        seen = view.project(point[None, None])
        return {
            "tool": tool.name,
            "target": target.name,
            "point": point,
            "local": P.rotate_inverse(root[3:], point - root[:3]),
            "normal": normal,
            "hit": hit,
            "tool_pose": pose,
            "quaternion": pose[3:],
            "commanded": sent is not None,
            "pixel": seen.pixel[0, 0],
            "depth": float(seen.depth[0, 0]),
            "inside": bool(seen.inside[0, 0]),
        }

    def _met(self, segment: Segment, target: Target, pose: Array) -> tuple[Array, Array, bool] | None:
        """A point of the target's surface, the normal there, and whether the ray met it."""
        geometry, view = self.scene.geometry, segment.last
        posed, own = geometry.posed(view.body_pose, view.present), geometry.on(target.bodies)
        along = P.rotate(pose[3:], np.array([0.0, 0.0, 1.0]))
        start = pose[:3] - self._reach * along
        world = WORLD_FRAME[None]
        ray = geometry.rays(posed, world, start[None], along[None], reach=2 * self._reach, seen=own, normals=True)
        if ray.geom[0, 0] >= 0:
            normal = ray.normal[0, 0]
            outward = normal if float(normal @ along) <= 0 else -normal  # it began inside of the thing
            return start + ray.distance[0, 0] * along, outward, True
        near = geometry.distances(posed, world, pose[None, :3], reach=self._reach, seen=own, normals=True)
        if near.geom[0, 0] < 0:
            return None
        return pose[:3] - near.distance[0, 0] * near.normal[0, 0], near.normal[0, 0], False
