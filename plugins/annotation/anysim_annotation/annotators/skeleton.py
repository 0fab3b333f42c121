"""Skeletons of robots: where the frames of their links are in the image."""

from collections.abc import Mapping

import numpy as np

from anysim.model.world import EntityKind
from anysim_annotation.api import Annotator, Field, Labels, Record, listed
from anysim_annotation.view import View


class Skeleton(Annotator):
    """Each robot that is there, whatever stands before it."""

    records: Mapping[str, Field] = {
        "robot": Field((), "name"),
        "links": Field(("L",), "name", "", "bodies of the robot, its root first"),
        "parents": Field(("L",), "1", "", "place of each link's parent among them, -1 for the root"),
        "position": Field(("L", 3), "m", "", "of the links' frames, world frame"),
        "pixels": Field(("L", 2), "px", "", "in the image; null behind the camera"),
        "depth": Field(("L",), "m", "", "along the optical axis"),
        "inside": Field(("L",), "1", "", "whether it is within the image"),
    }

    def annotate(self, view: View) -> Labels:
        world, rows = self.scene.world, list[list[Record]]()
        robots = [entity for entity in world.entities if entity.kind is EntityKind.ROBOT]
        seen = [view.project(view.body_pose[:, e.body_start : e.body_stop, :3]) for e in robots]
        for row in range(len(view)):
            found = list[Record]()
            for entity, image in zip(robots, seen, strict=True):
                if not view.present[row, world.entity_numbers[entity.name]]:
                    continue
                bodies = range(entity.body_start, entity.body_stop)
                parents = [
                    world.bodies[b].parent - bodies.start if world.bodies[b].parent in bodies else -1 for b in bodies
                ]
                found.append(
                    {
                        "robot": entity.name,
                        "links": [world.bodies[b].name for b in bodies],
                        "parents": parents,
                        "position": np.array(view.body_pose[row, bodies.start : bodies.stop, :3]),
                        "pixels": image.pixel[row],
                        "depth": image.depth[row],
                        "inside": image.inside[row],
                    }
                )
            rows.append(found)
        return listed(rows)
