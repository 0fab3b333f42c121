"""Independent readings of a robot's source, to hold our own against.

A reader is an entry point of the group `anysim.oracles` by file format: a function of a file, its root folder and the
body in it that is meant (see `anysim.assets.load.ModelFile`) that returns an `Oracle`. It shares no code with the
importer of that format. Where a robot has none (a procedural one), its Pinocchio model is asked, which shares the
importer and nothing of the engines.
"""

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from anysim import registry
from anysim.assets.catalogue import CatalogueEntry
from anysim.assets.load import ModelFile, model_file
from anysim.assets.vehicles import CARRIAGES, PLANAR_JOINTS
from anysim.conventions import Array
from anysim.errors import PluginError
from anysim.kinematics.pinocchio_model import RobotModel
from anysim.math import pose as P
from anysim.model.world import World
from anysim_robots.qualify.stage import NAME
from anysim_schemas.object_source import PROCEDURAL
from anysim_schemas.robot_model import PartSpec


class Follower(NamedTuple):
    """A joint of the source that follows another: position = multiplier * leader + offset."""

    leader: str
    multiplier: float
    offset: float


class Oracle(Protocol):
    """An independent reading of a source.

    Attributes:
        name: who reads.
        joints: how many degrees of freedom there are.
        mass: [kg] of all links; None where it cannot say.
        followers: by joint.
        root: the link at the root of the tree, whose frame everything is held against; where `frames` lack it, the
            source's own origin is.
    """

    name: str
    joints: int | None
    mass: float | None
    followers: Mapping[str, Follower]
    root: str

    def frames(self, joint_pos: Mapping[str, float]) -> Mapping[str, Array]:
        """Poses (7,) [m, xyzw] of links in one frame of the oracle's choice, at joint positions by name."""
        ...


def oracle_of(entry: CatalogueEntry, world: World) -> Oracle:
    """The best oracle that there is for a robot: readers of its files, put together; else its Pinocchio model.

    Raises:
        PluginError: the reader that it takes is not installed; says how to get it.
    """
    spec = entry.spec
    if spec.source.startswith(PROCEDURAL) or any(part.source.startswith(PROCEDURAL) for part in spec.parts):
        return _Pinocchio(world)
    main = _reader(model_file(spec.source, base=entry.file.parent))
    whole = _Composed(main, entry) if spec.parts else main
    return _OnPlane(whole) if spec.base == "planar" else whole


def _reader(file: ModelFile) -> Oracle:
    made = registry.load("oracles", file.kind)
    with registry.using("oracles", file.kind):
        return made(file.path, file.root, file.body)


class _Composed:
    """A robot with parts: each file read by itself, and put where the entry says."""

    def __init__(self, main: Oracle, entry: CatalogueEntry) -> None:
        self._main = main
        self._parts: list[tuple[PartSpec, Array, Oracle]] = []
        for part in entry.spec.parts:
            local = P.pose(part.position, P.from_roll_pitch_yaw(np.array(part.roll_pitch_yaw)))
            self._parts.append((part, local, _reader(model_file(part.source, base=entry.file.parent))))
        read = [main, *(reader for _, _, reader in self._parts)]
        self.name = " + ".join(dict.fromkeys(reader.name for reader in read)) + ", composed"
        self.root = main.root
        self.joints: int | None = None if any(r.joints is None for r in read) else sum(r.joints or 0 for r in read)
        self.mass: float | None = None if any(r.mass is None for r in read) else sum(r.mass or 0.0 for r in read)
        followers = dict(main.followers)
        for part, _, reader in self._parts:
            for joint, f in reader.followers.items():
                followers[part.prefix + joint] = f._replace(leader=part.prefix + f.leader)
        self.followers: Mapping[str, Follower] = followers

    def frames(self, joint_pos: Mapping[str, float]) -> Mapping[str, Array]:
        found = dict(self._main.frames(joint_pos))
        for part, local, reader in self._parts:
            own = {k.removeprefix(part.prefix): v for k, v in joint_pos.items() if k.startswith(part.prefix)}
            frames = reader.frames(own)
            root = frames.get(reader.root, P.pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
            place = P.compose(P.compose(found[part.link], local), P.inverse(root))
            found |= {part.prefix + link: P.compose(place, pose) for link, pose in frames.items()}
        return found


class _OnPlane:
    """A robot on the three joints that `base: planar` puts under it, and their two carriages."""

    def __init__(self, robot: Oracle) -> None:
        self._robot = robot
        self.name = f"{robot.name}, moved over the plane"
        self.joints: int | None = None if robot.joints is None else robot.joints + len(PLANAR_JOINTS)
        self.mass: float | None = None if robot.mass is None else robot.mass + CARRIAGES
        self.followers = robot.followers
        self.root = "rail"

    def frames(self, joint_pos: Mapping[str, float]) -> Mapping[str, Array]:
        x, y, yaw = (joint_pos[name] for name in PLANAR_JOINTS)
        place = P.pose((x, y, 0.0), (0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2))))
        own = {name: value for name, value in joint_pos.items() if name not in PLANAR_JOINTS}
        found = self._robot.frames(own)
        if self._robot.root in found:
            place = P.compose(place, P.inverse(found[self._robot.root]))
        return {link: P.compose(place, pose) for link, pose in found.items()}


class _Pinocchio:
    """The World's robot as Pinocchio moves it."""

    def __init__(self, world: World) -> None:
        self._model = RobotModel(world, NAME)
        self.name = "Pinocchio's model of the world"
        self.joints: int | None = None
        self.mass: float | None = None
        self.followers: Mapping[str, Follower] = {}
        self.root = self._model.root

    def frames(self, joint_pos: Mapping[str, float]) -> Mapping[str, Array]:
        model = self._model
        q = model.q(np.array([joint_pos[name] for name in model.joint_names]))
        return {name: model.frame_pose(q, index) for name, index in model.frames.items()}


class Urdf:
    """A URDF as yourdfpy reads it."""

    name = "yourdfpy"

    def __init__(self, path: Path, root: Path, body: str = "") -> None:
        del root, body
        self._file = _yourdfpy(path)
        robot = self._file.robot
        children = {joint.child for joint in robot.joints}
        several = [j for j in robot.joints if j.type in _SEVERAL and (j.type != "floating" or j.parent in children)]
        if several:
            raise PluginError(f"yourdfpy does not move joints of several axes ({several[0].type} '{several[0].name}')")
        moving = [joint for joint in robot.joints if joint.type not in ("fixed", "floating")]
        _lead(moving)
        self.joints: int | None = len(moving)
        masses = [link.inertial.mass for link in robot.links if link.inertial is not None]
        self.mass: float | None = float(sum(mass for mass in masses if mass is not None and isfinite(mass)))
        self.followers: Mapping[str, Follower] = {
            joint.name: Follower(
                joint.mimic.joint,
                1.0 if joint.mimic.multiplier is None else joint.mimic.multiplier,
                joint.mimic.offset or 0.0,
            )
            for joint in moving
            if joint.mimic is not None
        }
        self.root = next(link.name for link in robot.links if link.name not in children)

    def frames(self, joint_pos: Mapping[str, float]) -> Mapping[str, Array]:
        known = self._file.actuated_joint_names
        self._file.update_cfg({name: value for name, value in joint_pos.items() if name in known})
        return {link: _pose(self._file.get_transform(link, self.root)) for link in self._file.link_map}


def _lead(joints: Sequence[Any]) -> None:
    """Let what follows a follower follow the first of them: yourdfpy has the others stand still."""
    by_name = {joint.name: joint for joint in joints}
    for joint in joints:
        seen = {joint.name}
        while joint.mimic is not None and joint.mimic.joint in by_name and joint.mimic.joint not in seen:
            above = by_name[joint.mimic.joint].mimic
            if above is None:
                break
            seen.add(joint.mimic.joint)
            own, on = joint.mimic, 1.0 if joint.mimic.multiplier is None else joint.mimic.multiplier
            ratio = 1.0 if above.multiplier is None else above.multiplier
            offset = on * (above.offset or 0.0) + (own.offset or 0.0)
            joint.mimic = type(own)(joint=above.joint, multiplier=on * ratio, offset=offset)


def _pose(matrix: Array) -> Array:
    return np.concatenate([matrix[:3, 3], P.from_matrix(np.ascontiguousarray(matrix[:3, :3]))])


def _yourdfpy(path: Path):
    try:
        import yourdfpy
    except ImportError as error:
        raise PluginError(
            f"URDFs are held against yourdfpy, which is not installed ({error}): pip install 'anysim-robots[check]'"
        ) from None
    import logging

    logging.getLogger("yourdfpy").setLevel(logging.ERROR)
    try:
        return yourdfpy.URDF.load(str(path), load_meshes=False, build_collision_scene_graph=False)
    except Exception as error:  # it raises what its parsers do
        raise PluginError(f"yourdfpy cannot read {path.name}: {error}") from error


_SEVERAL = ("planar", "floating", "spherical")
