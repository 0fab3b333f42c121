"""A planning world as roboplan's scene: what stands still in the text of a URDF, what moves by itself added to it.

Links are the frames of the planned joints, so that geometry which is attached to one is placed in the frame of its
joint: roboplan 0.7 takes such placements relative to the joint above a link, whatever the frame of the link.
"""

from importlib import import_module
from itertools import chain, combinations
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from anysim.conventions import IDENTITY_QUATERNION
from anysim.errors import PluginError
from anysim.kinematics.pinocchio_model import from_se3
from anysim.math import pose as P
from anysim.model.world import World
from anysim_planning.roboplan_text import PACKAGE, Piece, matrix, pieces, urdf, write
from anysim_planning.scene import PlanningWorld

GROUP = "planned"
NOWHERE = P.pose((0.0, 0.0, -1000.0), IDENTITY_QUATERNION)
COLOR = np.ones(4)


class RoboplanScene:
    """One planning world in roboplan, whose `scene` has the group `GROUP` of the planned joints. For one thread."""

    def __init__(self, world: World, planned: PlanningWorld) -> None:
        self._world, self._planned = world, planned
        self._shapes = [
            pieces(world, geom.shape, padding, f"{g}")
            for g, (geom, padding) in enumerate(zip(planned.geoms, planned.padding, strict=True))
        ]
        self._still = {g: self._shapes[g] for g, geom in enumerate(planned.geoms) if planned.is_still(geom)}
        self._text = ""
        self.scene: Any = None

    def take(self) -> None:
        """Put everything where the planning world has it now."""
        text = urdf(self._world, self._planned, self._still)
        if text != self._text:
            with TemporaryDirectory(prefix="anysim-roboplan-") as folder:
                self._build(text, Path(folder))
            self._text = text
        for g, parts in enumerate(self._shapes):
            if g not in self._still:
                placed = self._planned.geometry.geometryObjects[g]
                parent = f"link_{placed.parentJoint}" if placed.parentJoint else "universe"
                for p, piece in enumerate(parts):
                    pose = P.compose(from_se3(placed.placement), piece.pose)
                    self.scene.updateGeometryPlacement(f"slot_{g}_{p}", parent, matrix(pose))

    def _build(self, text: str, folder: Path) -> None:
        core = roboplan_module("core")
        files = folder / PACKAGE
        files.mkdir()
        for piece in chain.from_iterable(self._shapes):
            write(piece, files)
        self.scene = core.Scene("anysim", core.loadUrdfSceneDescriptionFromXml(text, [str(folder)]))
        self.scene.addGroup(GROUP, [self._world.joints[j].name for j in self._planned.joints])
        names: list[list[str]] = []
        for g, parts in enumerate(self._shapes):
            names.append([f"geom_{g}"] if g in self._still else [f"slot_{g}_{p}" for p in range(len(parts))])
            if g not in self._still:
                for name, piece in zip(names[g], parts, strict=True):
                    self._add(core, name, piece, files)
        wanted = {frozenset((pair.first, pair.second)) for pair in self._planned.geometry.collisionPairs}
        apart = [
            (a, b)
            for i, j in combinations(range(len(names)), 2)
            if frozenset((i, j)) not in wanted
            for a in names[i]
            for b in names[j]
        ]
        apart += [pair for own in names for pair in combinations(own, 2)]
        if apart:
            self.scene.setCollisions(apart, False)

    def _add(self, core: Any, name: str, piece: Piece, files: Path) -> None:
        made = getattr(core, piece.kind.capitalize())(*(piece.size or (str(files / piece.file),)))
        add = getattr(self.scene, f"add{piece.kind.capitalize()}Geometry")
        add(name, "universe", made, matrix(NOWHERE), COLOR)


def roboplan_module(name: str) -> Any:
    """A part of roboplan, imported when it is used.

    Raises:
        PluginError: it is not installed; says how to get it.
    """
    try:
        return import_module(f"roboplan.{name}")
    except ImportError as error:
        words = f"the planner 'roboplan' needs roboplan ({error}): pip install 'anysim-planning[roboplan]'"
        raise PluginError(words) from None


def probe() -> None:
    """Look whether roboplan has attached geometry where it belongs: two balls that meet at one angle of a joint.

    Raises:
        PluginError: they do not; another version of roboplan reads placements differently.
    """
    core = roboplan_module("core")
    text = (
        '<robot name="probe"><link name="link_0"/><link name="link_1"/><joint name="turn" type="revolute">'
        '<parent link="link_0"/><child link="link_1"/><origin xyz="0 0 0.5" rpy="0 0 0.7"/><axis xyz="0 0 1"/>'
        '<limit lower="-3" upper="3" velocity="1" effort="1"/></joint><link name="post"><collision>'
        '<origin xyz="0 0.3 0.5"/><geometry><sphere radius="0.004"/></geometry></collision></link>'
        '<joint name="fixed" type="fixed"><parent link="link_0"/><child link="post"/></joint></robot>'
    )
    scene = core.Scene("probe", core.loadUrdfSceneDescriptionFromXml(text, []))
    scene.addSphereGeometry("ball", "universe", core.Sphere(0.004), matrix(NOWHERE), COLOR)
    scene.updateGeometryPlacement("ball", "link_1", matrix(P.pose((0.3, 0.0, 0.0), IDENTITY_QUATERNION)))
    meeting = np.array([np.pi / 2 - 0.7])
    if not scene.hasCollisions(meeting) or scene.hasCollisions(meeting + 0.1):
        raise PluginError(
            "roboplan does not have attached geometry where version 0.7 has it; install that one: "
            "pip install 'anysim-planning[roboplan]'"
        )
