"""Compilation of a robot by its catalogue entry."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from itertools import combinations
from typing import Any

import numpy as np

from anysim.assets.attach import attach
from anysim.assets.catalogue import CatalogueEntry, load_robot, missing_source
from anysim.assets.collision_shapes import with_collision
from anysim.assets.load import import_asset
from anysim.assets.meshes import VISUAL_ERROR
from anysim.assets.model import ImportedModel, ImportNote, noted
from anysim.assets.procedural import build
from anysim.assets.vehicles import as_vehicle
from anysim.compile.builder import WorldBuilder
from anysim.compile.collisions import with_solids
from anysim.compile.physical import GRIPPER_LIMIT_SOFTNESS, surface
from anysim.compile.vehicle import check_vehicle
from anysim.conventions import IDENTITY_QUATERNION
from anysim.errors import AssetError, Issues, PluginError, SpecError, listing, suggest
from anysim.kinematics import inertia
from anysim.math import pose as P
from anysim.model.hash import split
from anysim.model.world import (
    ORIGIN,
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
)
from anysim.randomization.distributions import extremes, nominal
from anysim_schemas.object_source import PROCEDURAL
from anysim_schemas.robot_model import ChannelSpec, GainSpec, RobotModelSpec, SensorPlaceSpec, ToolSpec
from anysim_schemas.robots import RobotSpec


def import_robot(entry: CatalogueEntry, visual_error: float = VISUAL_ERROR) -> ImportedModel:
    """The model of a catalogue entry: its source, with its parts fixed to it and its `collision` in place.

    `visual_error` [m] holds where the entry has none of its own.

    Raises:
        AssetError: a source is missing or damaged, says what to install where it comes with another package; or a part
            does not fit.
        PluginError: no importer or builder for it is installed.
    """
    spec = entry.spec
    if spec.visual_error is not None:
        visual_error = spec.visual_error
    try:
        own = spec.collision
        model = _read(entry, spec.source, spec.params, visual_error, f"the source of robot '{spec.name}'", own)
        brought = [
            _read(entry, part.source, part.params, visual_error, f"the source of parts.{i} of robot '{spec.name}'")
            for i, part in enumerate(spec.parts)
        ]
    except AssetError as error:
        absent = missing_source(entry) if spec.needs else ""
        remedy = f"; it needs another package: pip install '{spec.needs}'" if absent else ""
        raise AssetError(f"{error}{remedy}") from None
    for i, (part, more) in enumerate(zip(spec.parts, brought, strict=True)):
        pose = P.pose(part.position, P.from_roll_pitch_yaw(np.array(part.roll_pitch_yaw)))
        try:
            model = attach(model, more, part.link, pose, part.prefix)
        except AssetError as error:
            raise AssetError(f"parts.{i} of robot '{spec.name}': {error}") from None
    return with_solids(model, spec.collision)


def _read(
    entry: CatalogueEntry,
    source: str,
    params: Mapping[str, Any],
    visual_error: float,
    where: str,
    kept: Collection[str] = (),
) -> ImportedModel:
    """The model of one source of an entry."""
    try:
        if source.startswith(PROCEDURAL):
            return build(source.removeprefix(PROCEDURAL), params)
        more: Any = {"packages": entry.spec.packages, "visual_error": visual_error, "params": params}
        model = import_asset(source, base=entry.file.parent, **more)
        return with_collision(model, entry.spec.collision_shapes, kept)
    except SpecError as error:
        raise AssetError(f"{where} is not valid: {error}") from None


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
        model = as_vehicle(import_robot(entry, builder.visual_error), entry.spec)
    except (AssetError, PluginError) as error:
        issues.asset("robot", AssetError(f"robot '{spec.robot}': {error}"))
        return []
    assembly = _Assembly(name, spec, entry.spec, model, issues, issues.inside(entry.file.name))
    assembly.add_to(builder)
    return list(assembly.model.report)


class _Assembly:
    """One robot: the imported model, changed to what the catalogue entry and the spec say."""

    def __init__(
        self, name: str, spec: RobotSpec, entry: RobotModelSpec, model: ImportedModel, issues: Issues, own: Issues
    ) -> None:
        self.name, self.spec, self.entry, self.model = name, spec, entry, model
        self.issues, self.own = issues, own
        self.number = {joint.name: i for i, joint in enumerate(model.joints)}

    def add_to(self, builder: WorldBuilder) -> None:
        check_vehicle(self.entry, self.model, self.own)
        joints = self._joints()
        floating = self.entry.base == "floating"
        self._weigh(floating)
        bodies = tuple(
            replace(body, gravity_compensation=self.entry.gravity_compensation and (i > 0 or floating))
            for i, body in enumerate(self.model.bodies)
        )
        model = replace(self.model, joints=tuple(joints), bodies=bodies, geoms=self._geoms())
        model = replace(model, excluded_pairs=model.excluded_pairs | self._apart())
        x, y, z = nominal(self.spec.position)
        standing = (x, y, z + self.entry.base_height)
        position, quaternion = placement(standing, (0.0, 0.0, nominal(self.spec.yaw)))
        entity = builder.add(
            self.name,
            EntityKind.ROBOT,
            model,
            root=BodyKind.FREE if floating else BodyKind.STATIC,
            position=position,
            quaternion=quaternion,
            source=self.entry.source,
            license=_license(self.entry),
        )
        channels = self._channels(builder, entity, joints)
        tools = self._tools(builder, entity)
        self._sensors(builder, entity, tools)
        builder.robots.append(Robot(self.name, self.entry.name, channels, tools, self.entry))

    def _weigh(self, floating: bool) -> None:
        """Masses and inertias that what moves can have; the base may, which the source has fixed."""
        bodies = list(self.model.bodies)
        for i, body in enumerate(bodies[0 if floating else 1 :], 0 if floating else 1):
            fixed, text = inertia.repaired(body.inertial)
            if fixed.mass <= 0:
                self.own.add("base", f"the link '{body.name}' moves and has no mass; add one to the robot's source")
            elif text is not None:
                self.model = noted(self.model, ImportNote("repaired", f"link '{body.name}'", text))
            bodies[i] = replace(body, inertial=inertia.moving(fixed))
        self.model = replace(self.model, bodies=tuple(bodies))

    def _apart(self) -> frozenset[tuple[int, int]]:
        """Pairs of bodies that do not collide: all of them, or those that the entry excludes."""
        collides = self.entry.self_collision if self.spec.self_collision is None else self.spec.self_collision
        parents = [body.parent for body in self.model.bodies]
        pairs = [pair for pair in combinations(range(len(parents)), 2) if parents[pair[1]] != pair[0]]
        if not collides:
            return frozenset(pairs)
        links = list(self.model.links)
        apart: set[tuple[int, int]] = set()
        for number, patterns in enumerate(self.entry.self_collision_exclusions):
            found = [{self.model.links[k] for k in links if fnmatchcase(k, pattern)} for pattern in patterns]
            for pattern, bodies in zip(patterns, found, strict=True):
                if not bodies:
                    known = f"{suggest(pattern, links)} (links: {listing(links, 20)})"
                    self.own.add(f"self_collision_exclusions.{number}", f"no link matches '{pattern}'{known}")
            apart |= {(min(a, b), max(a, b)) for a in found[0] for b in found[1]}
        return frozenset(apart & set(pairs))

    # ------------------------------------------------------------------ joints and drives

    def _joints(self) -> list[Joint]:
        """Home positions, and what the channels say of armature, of losses, and of the gripper's limits."""
        joints = list(self.model.joints)
        for channel, spec in self.entry.channels.items():
            for index in self._known(spec.joints, self.own.at("channels", channel, "joints")):
                soft = GRIPPER_LIMIT_SOFTNESS if channel == "eef" else joints[index].limit_softness
                gains = self._gains(channel, joints[index].name)
                for i, joint in enumerate(joints):
                    if i == index or (joint.mimic is not None and joint.mimic.joint == index):
                        joints[i] = replace(
                            joint,
                            armature=joint.armature if gains.armature is None else gains.armature,
                            limit_softness=soft,
                            damping=joint.damping if gains.damping is None else gains.damping,
                            friction=joint.friction if gains.friction is None else gains.friction,
                        )
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
                joints[i] = replace(joint, initial=joint.mimic.position(joints[joint.mimic.joint].initial))
        return joints

    def _gains(self, channel: str, joint: str) -> GainSpec:
        """The drive of a joint: the last of `joint_gains` that matches, else the channel's, else the source's."""
        spec, own = self.entry.channels[channel], self.model.drive_of(self.number[joint])
        matching = [gains for pattern, gains in spec.joint_gains.items() if fnmatchcase(joint, pattern)]
        if matching or spec.gains is not None:
            return matching[-1] if matching else spec.gains or GainSpec(kp=0.0, kd=0.0)
        if own is not None and own.mode == spec.mode:
            return GainSpec(kp=own.kp, kd=own.kd)
        other = "" if own is None else f" (its source drives it by {own.mode}, the channel by {spec.mode})"
        self.own.at("channels", channel).add(
            "joint_gains", f"no gains for the joint '{joint}'; add them here or give the channel `gains`{other}"
        )
        return GainSpec(kp=0.0, kd=0.0)

    def _known(self, names: Sequence[str], issues: Issues) -> list[int]:
        unknown = [name for name in names if name not in self.number]
        for name in unknown:
            issues.add(
                "",
                f"the robot '{self.entry.name}' has no joint '{name}'{suggest(name, list(self.number))} "
                f"(joints: {listing(self.number, 20)})",
            )
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
                gains = self._gains(name, joints[index].name)
                actuators.append(len(builder.actuators))
                own, effort = self.model.drive_of(index), joints[index].effort_limit
                effort = min(effort, own.effort_limit) if own is not None else effort
                effort = effort if gains.effort_limit is None else gains.effort_limit
                drive = f"{self.name}.{joints[index].name}"
                start = entity.joint_start
                shares = () if own is None else tuple((start + j, ratio) for j, ratio in own.shares)
                builder.actuators.append(
                    Actuator(drive, start + index, ControlMode(spec.mode), gains.kp, gains.kd, effort, shares)
                )
            self._check_channel(spec, issues)
            world = tuple(entity.joint_start + index for index in indices)
            channels[name] = Channel(name, world, tuple(actuators), spec.opened, spec.closed)
        for name in self.spec.actions:
            if name not in channels:
                known = f"{suggest(name, list(channels))} (channels: {listing(channels)})"
                self.issues.add(f"actions.{name}", f"the robot '{self.entry.name}' has no channel '{name}'{known}")
        return channels

    def _check_channel(self, spec: ChannelSpec, issues: Issues) -> None:
        """Names and lengths inside of a channel."""
        postures = {"opened": spec.opened, "closed": spec.closed}
        postures |= {f"synergies.{name}": values for name, values in spec.synergies.items()}
        for place, values in postures.items():
            if values is not None and len(values) != len(spec.joints):
                issues.add(place, f"expected {len(spec.joints)} values, one a joint, got {len(values)}")
        for group, joints in spec.groups.items():
            for joint in joints:
                if joint not in spec.joints:
                    known = f"{suggest(joint, list(spec.joints))} (joints: {listing(spec.joints, 20)})"
                    issues.add(f"groups.{group}", f"the channel has no joint '{joint}'{known}")
        for pattern in spec.joint_gains:
            if not any(fnmatchcase(joint, pattern) for joint in spec.joints):
                known = f"{suggest(pattern, list(spec.joints))} (joints: {listing(spec.joints, 20)})"
                issues.add(f"joint_gains.{pattern}", f"no joint of the channel matches{known}")

    # ------------------------------------------------------------------ frames and surfaces

    def _tools(self, builder: WorldBuilder, entity: Entity) -> dict[str, int]:
        """The sites of the tools by name."""
        return {
            name: site
            for name, spec in self.entry.tools.items()
            if (site := self._frame(builder, entity, "tools", name, spec)) is not None
        }

    def _sensors(self, builder: WorldBuilder, entity: Entity, tools: Mapping[str, int]) -> None:
        for name, spec in self.entry.sensors.items():
            if name in tools:
                self.own.add(f"sensors.{name}", f"there is a tool '{name}' already; give the sensor another name")
                continue
            self._frame(builder, entity, "sensors", name, spec)

    def _frame(
        self, builder: WorldBuilder, entity: Entity, kind: str, name: str, spec: ToolSpec | SensorPlaceSpec
    ) -> int | None:
        """The site of a tool or sensor, a new one or that of the file it names; None where there can be none."""
        frames = self.model.frames
        if spec.link not in frames:
            known = f"{suggest(spec.link, list(frames))} (links: {listing(frames, 20)})"
            self.own.add(f"{kind}.{name}.link", f"there is no link '{spec.link}'{known}")
            return None
        local = P.pose(spec.position, P.from_roll_pitch_yaw(np.array(spec.roll_pitch_yaw)))
        full = f"{self.name}.{name}"
        if name in frames:
            named = [i for i, site in enumerate(builder.sites) if site.name == full]
            if named and spec.link == name and split(local) == (ORIGIN, IDENTITY_QUATERNION):
                return named[0]
            self.own.add(f"{kind}.{name}", f"there is a link named '{name}' already; give the {kind[:-1]} another name")
            return None
        carrier = frames[spec.link]
        position, quaternion = split(P.compose(P.pose(carrier.position, carrier.quaternion), local))
        builder.sites.append(Site(full, entity.body_start + carrier.body, position, quaternion))
        return len(builder.sites) - 1

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


def _license(entry: RobotModelSpec) -> str:
    """The licences of the robot and its parts, as one SPDX expression."""
    several = list(dict.fromkeys([entry.license, *(part.license for part in entry.parts)]))
    return several[0] if len(several) == 1 else " AND ".join(f"({x})" if " " in x else x for x in several)


def placement(position: Sequence[float], roll_pitch_yaw: Sequence[float]) -> tuple[Vec3, Quat]:
    """A pose as the World holds it."""
    return split(P.pose(tuple(position), P.from_roll_pitch_yaw(np.array(roll_pitch_yaw))))
