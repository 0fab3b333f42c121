"""Trail of the tools in the image: where each is, and where it was in the last steps, as the camera sees it now."""

from collections import deque
from collections.abc import Mapping
from typing import Annotated

import numpy as np
from pydantic import Field as Checked

from anysim.conventions import Array
from anysim_annotation.api import Annotator, Field, Labels, Record, listed
from anysim_annotation.tools import placed, tools_of
from anysim_annotation.view import Scene, View


class EefWaypoint(Annotator):
    """Each tool of each robot, or those in `tools` (`left.tool`), whatever stands before it."""

    records: Mapping[str, Field] = {
        "tool": Field((), "name"),
        "pose": Field((7,), "m, xyzw", "", "world frame"),
        "pixel": Field((2,), "px", "", "in the image; null behind the camera"),
        "depth": Field((), "m", "", "along the optical axis"),
        "inside": Field((), "1", "", "whether it is within the image"),
        "trail": Field(
            ("K", 2), "px", "", "where it was in the labelled images before, the latest last, in this image"
        ),
    }

    def __init__(
        self,
        scene: Scene,
        *,
        tools: tuple[str, ...] = (),
        trail: Annotated[int, Checked(ge=0, description="how many images before count")] = 16,
    ) -> None:
        super().__init__(scene)
        self._tools, self._length = tools_of(scene.world, tools), trail
        self._past: dict[tuple[int, str], deque[Array]] = {}

    def reset(self, env_ids: Array) -> None:
        gone = set(env_ids.tolist())
        self._past = {key: past for key, past in self._past.items() if key[0] not in gone}

    def annotate(self, view: View) -> Labels:
        rows: list[list[Record]] = [[] for _ in range(len(view))]
        for tool in self._tools:
            poses = placed(tool.frame, view.body_pose)
            seen = view.project(poses[:, None, :3])
            for row, env in enumerate(view.env_ids.tolist()):
                past = self._past.setdefault((env, tool.name), deque(maxlen=self._length))
                before = np.array(past).reshape(1, -1, 3)
                record: Record = {
                    "tool": tool.name,
                    "pose": poses[row],
                    "pixel": seen.pixel[row, 0],
                    "depth": float(seen.depth[row, 0]),
                    "inside": bool(seen.inside[row, 0]),
                    "trail": view.row(row).project(before).pixel[0],
                }
                rows[row].append(record)
                past.append(poses[row, :3].copy())
        return listed(rows)
