"""A robot of a spec, by its catalogue entry, into a World under construction."""

from collections.abc import Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from itertools import combinations

import numpy as np

from anysim.errors import AssetError, PluginError, SpecError, listing, suggest
from anysim.math import pose as P
from anysim.world.builder import WorldBuilder
from anysim.world.catalogue import load_robot
from anysim.world.imported import ImportedModel, ImportNote
from anysim.world.importers import import_asset
from anysim.world.issues import Issues
from anysim.world.model import (
    Actuator,
    BodyKind,
    Channel,
    ControlMode,
    Entity,
    EntityKind,
    Geom,
    Joint,
    Quat,
    Robot,
    Site,
    Vec3,
)  # fmt: skip
from anysim.world.nominal import extremes, nominal
from anysim.world.presets import GRIPPER_LIMIT_SOFTNESS, surface
from anysim.world.rounding import split
from anysim_schemas.robots import RobotModelSpec, RobotSpec


def add_robot(builder: WorldBuilder, name: str, spec: RobotSpec, issues: Issues) -> list[ImportNote]:
    """Add a robot; what is wrong goes to `issues`, whose path is that of the robot. Returns the import's notes."""
    try:
        entry = load_robot(spec.robot)
    except PluginError as error:
        issues.add("robot", str(error))
        return []
    except SpecError as error:
        issues.add("robot", f"the catalogue entry is not valid: {error}")
        return []
    try:
        model = import_asset(entry.spec.source, base=entry.file.parent)
    except (AssetError, PluginError) as error:
        issues.asset("robot", AssetError(f"robot '{spec.robot}': {error}"))
        return []
    assembly = _Assembly(name, spec, entry.spec, model, issues, issues.inside(entry.file.name))
    assembly.add_to(builder)
    return list(model.report)


class _Assembly:
    """One robot: the imported model, changed to what the catalogue entry and the spec say."""

    def __init__(
        self, name: str, spec: RobotSpec, entry: RobotModelSpec, model: ImportedModel, issues: Issues, own: Issues
    ) -> None:
        self.name, self.spec, self.entry, self.model = name, spec, entry, model
        self.issues, self.own = issues, own
        self.number = {joint.name: i for i, joint in enumerate(model.joints)}

    def add_to(self, builder: WorldBuilder) -> None:
        joints = self._joints()
        floating = self.entry.base == "floating"
        bodies = tuple(
            replace(body, gravity_compensation=self.entry.gravity_compensation and (i > 0 or floating))
            for i, body in enumerate(self.model.bodies)
        )
        model = replace(self.model, joints=tuple(joints), bodies=bodies, geoms=self._geoms())
        collides = self.entry.self_collision if self.spec.self_collision is None else self.spec.self_collision
        if not collides:
            pairs = combinations(range(len(bodies)), 2)
            apart = frozenset(p for p in pairs if bodies[p[1]].parent != p[0])
            model = replace(model, excluded_pairs=model.excluded_pairs | apart)
        position, quaternion = placement(nominal(self.spec.position), (0.0, 0.0, nominal(self.spec.yaw)))
        entity = builder.add(
            self.name, EntityKind.ROBOT, model, root=BodyKind.FREE if floating else BodyKind.STATIC, position=position,
            quaternion=quaternion, source=self.entry.source, license=self.entry.license,
        )  # fmt: skip
        channels = self._channels(builder, entity, joints)
        tools = self._tools(builder, entity)
        builder.robots.append(Robot(self.name, self.entry.name, channels, tools))

    # ------------------------------------------------------------------ joints and drives

    def _joints(self) -> list[Joint]:
        """Home positions, and what the channels say of armature and of the gripper's limits."""
        joints = list(self.model.joints)
        for channel, spec in self.entry.channels.items():
            for index in self._known(spec.joints, self.own.at("channels", channel, "joints")):
                soft = GRIPPER_LIMIT_SOFTNESS if channel == "eef" else joints[index].limit_softness
                for i, joint in enumerate(joints):
                    if i == index or (joint.mimic is not None and joint.mimic.joint == index):
                        joints[i] = replace(joint, armature=spec.gains.armature, limit_softness=soft)
        for home, issues in ((self.entry.home, self.own.at("home")), (self.spec.home, self.issues.at("home"))):
            for name, value in home.items():
                for index in self._known((name,), issues):
                    joint = joints[index]
                    low, high = extremes(value)
                    if not (joint.lower - 1e-9 <= low and high <= joint.upper + 1e-9):
                        far = low if low < joint.lower - 1e-9 else high
                        issues.add(name, f"{far:g} is outside of the joint's limits [{joint.lower:g}, {joint.upper:g}]")
                    elif joint.mimic is not None:
                        leader = joints[joint.mimic.joint].name
                        issues.add(name, f"'{name}' follows '{leader}'; give the home of that one")
                    else:
                        joints[index] = replace(joint, initial=float(nominal(value)))
        issues = self.issues.at("home_velocity")
        for name in self.spec.home_velocity:
            for index in self._known((name,), issues):
                mimic = joints[index].mimic
                if mimic is not None:
                    issues.add(name, f"'{name}' follows '{joints[mimic.joint].name}'; give the velocity of that one")
        for i, joint in enumerate(joints):
            if joint.mimic is not None:
                leader = joints[joint.mimic.joint]
                joints[i] = replace(joint, initial=joint.mimic.multiplier * leader.initial + joint.mimic.offset)
        return joints

    def _known(self, names: Sequence[str], issues: Issues) -> list[int]:
        unknown = [name for name in names if name not in self.number]
        for name in unknown:
            issues.add(
                "", f"the robot '{self.entry.name}' has no joint '{name}'{suggest(name, list(self.number))} "
                f"(joints: {listing(self.number, 20)})",
            )  # fmt: skip
        return [self.number[name] for name in names if name in self.number]

    def _channels(self, builder: WorldBuilder, entity: Entity, joints: Sequence[Joint]) -> dict[str, Channel]:
        channels: dict[str, Channel] = {}
        driven: dict[int, str] = {}
        for name, spec in self.entry.channels.items():
            issues = self.own.at("channels", name)
            indices = [self.number[joint] for joint in spec.joints if joint in self.number]
            actuators: list[int] = []
            for index in indices:
                if index in driven:
                    issues.add("joints", f"'{joints[index].name}' is driven by the channel '{driven[index]}' already")
                driven[index] = name
                limit = spec.gains.effort_limit
                actuators.append(len(builder.actuators))
                effort = joints[index].effort_limit if limit is None else limit
                drive = f"{self.name}.{joints[index].name}"
                builder.actuators.append(
                    Actuator(
                        drive, entity.joint_start + index, ControlMode.POSITION, spec.gains.kp, spec.gains.kd, effort
                    )
                )
            for end in ("opened", "closed"):
                values = getattr(spec, end)
                if values is not None and len(values) != len(spec.joints):
                    issues.add(end, f"expected {len(spec.joints)} values, one a joint, got {len(values)}")
            world = tuple(entity.joint_start + index for index in indices)
            channels[name] = Channel(name, world, tuple(actuators), spec.opened, spec.closed)
        for name in self.spec.actions:
            if name not in channels:
                known = f"{suggest(name, list(channels))} (channels: {listing(channels)})"
                self.issues.add(f"actions.{name}", f"the robot '{self.entry.name}' has no channel '{name}'{known}")
        return channels

    # ------------------------------------------------------------------ frames and surfaces

    def _tools(self, builder: WorldBuilder, entity: Entity) -> dict[str, int]:
        tools: dict[str, int] = {}
        frames = {site.name: (site.body, P.pose(site.position, site.quaternion)) for site in self.model.sites}
        for link, body in self.model.links.items():
            frames.setdefault(link, (body, P.pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))))
        for name, spec in self.entry.tools.items():
            if spec.link not in frames:
                known = f"{suggest(spec.link, list(frames))} (links: {listing(frames, 20)})"
                self.own.add(f"tools.{name}.link", f"there is no link '{spec.link}'{known}")
                continue
            if name in frames:
                self.own.add(f"tools.{name}", f"there is a link named '{name}' already; give the tool another name")
                continue
            body, frame = frames[spec.link]
            local = P.pose(spec.position, P.from_roll_pitch_yaw(np.array(spec.roll_pitch_yaw)))
            position, quaternion = split(P.compose(frame, local))
            tools[name] = len(builder.sites)
            builder.sites.append(Site(f"{self.name}.{name}", entity.body_start + body, position, quaternion))
        return tools

    def _geoms(self) -> tuple[Geom, ...]:
        """The model's geoms with the surfaces that the entry gives to their links; a later entry wins."""
        geoms = list(self.model.geoms)
        links = list(self.model.links)
        for i, spec in enumerate(self.entry.surfaces):
            for pattern in spec.links:
                if not any(fnmatchcase(link, pattern) for link in links):
                    known = f"{suggest(pattern, links)} (links: {listing(links, 20)})"
                    self.own.add(f"surfaces.{i}.links", f"no link matches '{pattern}'{known}")
            for k, geom in enumerate(geoms):
                if geom.collides and any(fnmatchcase(self.model.geom_links[k], pattern) for pattern in spec.links):
                    friction = geom.surface.friction if spec.friction is None else spec.friction
                    geoms[k] = replace(geom, surface=surface(spec.contact, friction, geom.surface.restitution))
        return tuple(geoms)


def placement(position: Sequence[float], roll_pitch_yaw: Sequence[float]) -> tuple[Vec3, Quat]:
    """A pose as the World holds it."""
    return split(P.pose(tuple(position), P.from_roll_pitch_yaw(np.array(roll_pitch_yaw))))
