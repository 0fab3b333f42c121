"""A draft of a catalogue entry as YAML that loads and builds, with comments where a person has to decide."""

import json
import re
from collections.abc import Mapping
from dataclasses import replace
from math import inf, isinf
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from anysim.assets.collision_shapes import with_collision
from anysim.assets.load import import_asset, split_body
from anysim.assets.model import ImportedModel
from anysim.errors import AssetError
from anysim.model.world import ControlMode, Joint
from anysim_robots.drafting.gains import BANDWIDTH, ROTOR, SAG, SETTLING, STANDING, Gains, gains
from anysim_robots.drafting.guess import Guess, guess, home_of, within
from anysim_robots.drafting.places import places, quoted
from anysim_robots.drafting.sources import source_of
from anysim_robots.drafting.srdf import Srdf, beside, read
from anysim_robots.drafting.stance import stood

HOMES = ("home", "ready", "half_sitting", "standing", "default", "initial")
"""Names of poses that a robot begins in, the likelier first."""

GRIPPER = 4
"""Joints that one command opens and closes at first; fingers of a hand are moved one by one."""
NO_LICENCE = "LicenseRef-TODO"


class Draft(NamedTuple):
    """What is known of a model. `open` is what nobody but a person can say; `notes` are the importer's.

    `packages` are the folders of what the file refers to as `package://NAME/…`, absolute, by NAME; `arguments` those
    of a xacro; `uri` is the name of a file that has another than its path.
    """

    name: str
    file: Path
    model: ImportedModel
    guess: Guess
    gains: dict[str, Gains]
    open: tuple[str, ...]
    notes: tuple[str, ...]
    packages: Mapping[str, Path] = MappingProxyType({})
    arguments: Mapping[str, Any] = MappingProxyType({})
    uri: str = ""
    srdf: Srdf | None = None

    def text(self, folder: Path) -> str:
        """The YAML, for a file in this folder."""
        return "\n".join([*self._head(folder), *self._channels(), *self._rest(), ""])

    # ------------------------------------------------------------------ parts of the file

    def _head(self, folder: Path) -> list[str]:
        g, source = self.guess, self.uri or _source(self.file, folder, self)
        lines = [f"# Draft of {self.file.name}, made by `anysim robot import`. What begins with TODO needs a person."]
        lines += [f"# TODO {words}" for words in self.open]
        lines += [f"# Importer: {' '.join(words.split())}" for words in self.notes]
        return [
            *lines,
            f"name: {self.name}",
            f"description: {len(self.model.joints)} joints, from {self.file.name}  # TODO one line for people",
            f"source: {quoted(source)}",
            *(
                ["params:", *(f"  {quoted(k)}: {json.dumps(v)}" for k, v in self.arguments.items())]
                * bool(self.arguments)
            ),
            *self._packages(folder),
            f"license: {NO_LICENCE}",
            "license_source: TODO",
            f"category: {g.category}",
            *(f"# Guessed: {reason}" for reason in g.reasons),
            f"base: {'floating' if g.floating else 'fixed'}",
            *([f"base_height: {g.base_height}  # lowest shape at the initial joint positions"] if g.floating else []),
        ]

    def _packages(self, folder: Path) -> list[str]:
        """The folders below that of the file as they lie there, all others absolute."""
        if not self.packages:
            return []
        folder = folder.resolve()
        places = {
            name: str(place.relative_to(folder) if place.is_relative_to(folder) else place)
            for name, place in self.packages.items()
        }
        return ["packages:", *(f"  {quoted(name)}: {quoted(place)}" for name, place in places.items())]

    def _channels(self) -> list[str]:
        g = self.guess
        legs = tuple(dict.fromkeys(joint for leg in g.legs for joint in leg.joints))
        base = g.carried or legs + tuple(wheel for wheel in g.wheels if wheel not in legs)
        channels = {"base": base, "arm": g.arm, "eef": g.eef}
        if not any(channels.values()):
            return ["channels: {}"]
        lines = ["# Gains and armature that are not the file's are guessed: critically damped at"]
        lines += [
            f"# {BANDWIDTH:g} Hz with the inertia that each joint sees at home; armature is {100 * ROTOR:g} % of that"
        ]
        lines[-1] += (
            f"; legs: kp at least {STANDING:g} m times the weight, kd {SETTLING:g} s times kp." if legs else "."
        )
        if not _compensated(g):
            lines += [f"# No weight is compensated: kp is at least what bears it within {SAG:g} rad or m of home."]
        lines.append("channels:")
        for name, joints in channels.items():
            if not joints:
                continue
            lines += [f"  {name}:", f"    joints: [{', '.join(map(quoted, joints))}]", "    joint_gains:"]
            velocity = set(joints) <= set(g.wheels)
            if velocity:
                lines.insert(-1, "    mode: velocity")
            lines += [
                self._drive(joint, ControlMode.VELOCITY if velocity else ControlMode.POSITION) for joint in joints
            ]
            lines += self._groups(joints)
            lines += self._controllers(name, joints)
        return lines

    def _groups(self, joints: tuple[str, ...]) -> list[str]:
        """Parts of a channel that the SRDF names."""
        groups = {} if self.srdf is None else self.srdf.groups
        inside = {name: own for name, own in groups.items() if set(own) < set(joints) and re.fullmatch(r"\w+", name)}
        lines = [f"      {quoted(name)}: [{', '.join(map(quoted, own))}]" for name, own in inside.items()]
        return ["    groups:  # of the SRDF", *lines] if lines else []

    def _drive(self, name: str, mode: ControlMode) -> str:
        """The line of a joint: what the file says of its drive where that is of this mode, else guesses."""
        own, joint = self.gains[name], next(j for j in self.model.joints if j.name == name)
        found = self.model.drive_of(self.model.joints.index(joint))
        of_file = [] if found is None or isinf(found.effort_limit) else ["its effort limit"]
        kp, kd = 0.0 if mode is ControlMode.VELOCITY else own.kp, own.kd
        if found is not None and found.mode is mode and (found.kp or found.kd):
            kp, kd = found.kp, found.kd
            of_file.insert(0, "kp and kd")
        values = [f"kp: {kp:g}", f"kd: {kd:g}"]
        if joint.armature > 0:
            of_file.append("armature")
        else:
            values.append(f"armature: {own.armature:g}")
        if _limit(self.model, joint) is None:
            values.append(f"effort_limit: {float(f'{max(1.0, own.kp):.2g}'):g}")
        told = f"  # the file's: {', '.join(of_file)}" if of_file else ""
        return f"      {quoted(name)}: {{{', '.join(values)}}}{told}"

    def _controllers(self, name: str, joints: tuple[str, ...]) -> list[str]:
        if name == "eef":
            ends = [self._ends(joint) for joint in joints]
            if all(end is not None for end in ends):
                opened = ", ".join(repr(end[0]) for end in ends if end is not None)
                closed = ", ".join(repr(end[1]) for end in ends if end is not None)
                gripper, hand = "gripper_binary: {}, joint_position: {}", "joint_position: {}, gripper_binary: {}"
                return [
                    f"    opened: [{opened}]  # the limit that is farther from zero",
                    f"    closed: [{closed}]",
                    f"    controllers: {{{gripper if len(joints) <= GRIPPER else hand}}}",
                ]
        if set(joints) <= set(self.guess.wheels):
            return []
        return ["    controllers: {joint_position: {}, joint_delta_position: {}}"]

    def _at_an_end(self) -> dict[str, float]:
        """Where a gripper begins that one command opens or closes: at the end that is nearer to where it is."""
        eef = self.guess.eef
        ends = [self._ends(joint) for joint in eef]
        if not 0 < len(eef) <= GRIPPER or any(end is None for end in ends):
            return {}
        at = {joint.name: joint.initial for joint in self.model.joints}
        pairs = [(end[0], end[1]) for end in ends if end is not None]
        far = [sum(abs(at[joint] - pair[side]) for joint, pair in zip(eef, pairs, strict=True)) for side in (0, 1)]
        side = 0 if far[0] <= far[1] else 1
        return {joint: pair[side] for joint, pair in zip(eef, pairs, strict=True) if pair[side] != at[joint]}

    def _ends(self, joint: str) -> tuple[float, float] | None:
        """Open and closed position of a finger."""
        found = next(j for j in self.model.joints if j.name == joint)
        if isinf(found.lower) or isinf(found.upper):
            return None
        ends = sorted((within(found.lower, found, 6), within(found.upper, found, 6)), key=abs)
        return ends[1], ends[0]

    def _rest(self) -> list[str]:
        g, lines = self.guess, []
        home, poses = home_of(self.model) | self._at_an_end(), {} if self.srdf is None else self.srdf.poses
        told = _home_pose(self.srdf)
        if told:
            lines.append(f"# Home is the pose '{told}' of the SRDF, within the limits.")
        for name, pose in poses.items():
            if name != told and pose:
                lines.append(f"# Pose '{name}' of the SRDF: {{{', '.join(f'{j}: {v:g}' for j, v in pose.items())}}}")
        if home:
            lines += ["home:", *(f"  {quoted(joint)}: {value!r}" for joint, value in home.items())]
        if g.tool is not None:
            lines += [
                "tools:",
                f"  tool: {{link: {quoted(g.tool)}}}  # z should point out of the hand, y along the opening",
            ]
        if g.legs:
            lines += ["legs:"]
            for leg in g.legs:
                joints = ", ".join(map(quoted, leg.joints))
                lines.append(f"  {leg.name}: {{joints: [{joints}], foot: {quoted(leg.foot)}}}")
        lines += places(self.model)
        weighed = "true" if _compensated(g) else "false"
        apart = () if self.srdf is None else self.srdf.apart
        if apart:
            lines.append("# Pairs of the SRDF, for `self_collision: true`")
            lines += ["self_collision_exclusions:", *(f"  - [{quoted(a)}, {quoted(b)}]" for a, b in apart)]
        lines += ["self_collision: false", f"gravity_compensation: {weighed}"]
        return lines


def draft(
    file: Path | str,
    name: str | None = None,
    packages: Mapping[str, Path] = MappingProxyType({}),
    arguments: Mapping[str, Any] = MappingProxyType({}),
) -> Draft:
    """Look at a model.

    Args:
        file: a model file, `FILE.xml#BODY` for one of several bodies; a folder with one; or a name of
            robot_descriptions.
        name: in the catalogue; that of the body or the file where not given.
        packages: folders of what a URDF refers to as `package://NAME/…`, by NAME.
        arguments: of a xacro, by name.

    Raises:
        AssetError: there is no such file or folder, or it cannot be imported.
    """
    source = source_of(str(file))
    body = split_body(str(source.file))[1]
    path = source.file.resolve()
    folders = {package: folder.resolve() for package, folder in {**source.packages, **packages}.items()}
    arguments = {**source.arguments, **arguments}
    model = with_collision(import_asset(source.uri or str(path), packages=_named(folders), params=arguments), None)
    beside_it = beside(path)
    srdf = None if beside_it is None else read(beside_it, model)
    if srdf is not None:
        model = _at_home(model, srdf)
    found = guess(model)
    if found.floating and not _home_pose(srdf):
        model, stance = stood(model, found.legs)
        if stance:
            found = found._replace(base_height=guess(model).base_height, reasons=(*found.reasons, stance))
    legs = frozenset(joint for leg in found.legs for joint in leg.joints)
    named = source.uri.partition(":")[2]
    stem = named if named and "/" not in named else path.name.split(".")[0]
    chosen = re.sub(r"\W+", "_", name or body or stem).strip("_").lower()
    if not chosen or not chosen[0].isalpha():
        chosen = f"robot_{chosen}".rstrip("_")
    notes = tuple(str(note) for note in (*model.report, *(() if srdf is None else srdf.notes)))
    return Draft(
        chosen,
        path,
        model,
        found,
        gains(model, found.floating, legs, weighed=not _compensated(found)),
        tuple(_open(model, found)),
        notes,
        folders,
        arguments,
        source.uri,
        srdf,
    )


def _compensated(found: Guess) -> bool:
    """Whether what a joint bears is compensated: of robots that are bolted down, or carried over the ground."""
    return not (found.floating or found.anchored)


def _home_pose(srdf: Srdf | None) -> str:
    """The name of the pose that a robot begins in; empty where the SRDF has none of `HOMES`."""
    return "" if srdf is None else next((name for name in HOMES if srdf.poses.get(name)), "")


def _at_home(model: ImportedModel, srdf: Srdf) -> ImportedModel:
    """The model with its joints where the SRDF has them at first, within their limits."""
    pose = srdf.poses.get(_home_pose(srdf), {})
    joints = tuple(
        replace(joint, initial=min(max(pose[joint.name], joint.lower), joint.upper))
        if joint.name in pose and joint.mimic is None
        else joint
        for joint in model.joints
    )
    return replace(model, joints=joints)


def _open(model: ImportedModel, found: Guess) -> list[str]:
    """What could not be inferred."""
    asked = [
        "license: the SPDX expression of the files, and where it is stated; a robot without one may not be used",
        "gains and armature: those that are not said to be the file's are guessed from inertia; take the maker's",
    ]
    followers = [joint.name for joint in model.joints if joint.mimic is not None]
    if followers:
        asked.append(
            f"mimic: {', '.join(followers)} follow other joints and are in no channel; drive them if the robot does"
        )
    if found.legs:
        asked.append(
            "home: a pose in which it stands, with bent knees, and base_height for it; legs: radius or sole of the feet"
        )
    if found.floating and not found.legs and not found.wheels:
        asked.append("base: it floats in the file, and neither legs nor wheels were recognised")
    if found.wheels:
        asked.append("controllers of base: the drive model of the wheels, with their radius and distances")
    if found.eef:
        asked.append("eef: opened and closed are limits of the joints; try `anysim robot FILE --picture`")
    if found.tool is None:
        asked.append("tools: no frame that tasks could refer to was recognised")
    else:
        asked.append(f"tools: '{found.tool}' was chosen by its name or place; check the direction of its axes")
    if found.anchored:
        asked.append(f"{', '.join(found.anchored)}: move it against the world, and no drive of the file moves them")
    unlimited = [j.name for j in model.joints if j.mimic is None and _limit(model, j) is None]
    if unlimited:
        asked.append(f"effort limits: the source has none for {', '.join(unlimited[:6])}{'…' * (len(unlimited) > 6)}")
    if not any(geom.collides for geom in model.geoms):
        asked.append("collision shapes: the source has none; the robot passes through everything")
    rest = "surfaces and self_collision are not in the file"
    asked.append(rest if model.sensors else f"sensors, {rest}")
    return asked


def _limit(model: ImportedModel, joint: Joint) -> float | None:
    """The largest effort that the source states of a joint or its drive; None without one that moves anything."""
    drive = model.drive_of(model.joints.index(joint))
    limit = min(joint.effort_limit, inf if drive is None else drive.effort_limit)
    return limit if 0 < limit < inf else None


def _named(packages: Mapping[str, Path]) -> dict[str, str]:
    return {name: str(folder) for name, folder in packages.items()}


def _source(file: Path, folder: Path, made: Draft) -> str:
    """The file as the entry names it: relative where all that it refers to is below, else absolute."""
    folder = folder.resolve()
    if file.is_relative_to(folder):
        relative = str(file.relative_to(folder))
        try:
            import_asset(relative, base=folder, packages=_named(made.packages), params=made.arguments)
        except AssetError:
            return str(file)
        return relative
    return str(file)
