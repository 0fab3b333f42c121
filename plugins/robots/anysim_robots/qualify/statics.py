"""The checks in which nothing moves by itself: what was built is what the source says."""

import re

import numpy as np

from anysim.assets.model import ImportNote
from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.errors import listing
from anysim.math import pose as P
from anysim.model.frames import FixedFrame, find_frame
from anysim.model.world import JointType, World
from anysim.testing.audit import audit
from anysim_robots.qualify.oracle import Oracle
from anysim_robots.qualify.result import Check, Facts
from anysim_robots.qualify.stage import NAME

CONFIGURATIONS = 20
MASS = 1e-5
"""Relative."""
FRAMES = 1e-6
"""[m], the largest distance between two readings of where a link is, and of further out as a share of that distance."""
VIRTUAL = 0.01
"""[kg] that an importer may have given to links of a source without mass, in all; more, where it says how much."""
GIVEN, ROUNDED = re.compile(r"moves without mass; now (\S+) kg"), 0.01
"""What it says of such a link, and how far its rounded numbers may be off in all, as a share."""


def facts_of(world: World) -> Facts:
    """What the robot is."""
    entity = next(e for e in world.entities if e.name == NAME)
    joints = world.joints[entity.joint_start : entity.joint_stop]
    bodies = world.bodies[entity.body_start : entity.body_stop]
    mass = sum(body.inertial.mass for body in bodies)
    followers = sum(joint.mimic is not None for joint in joints)
    return Facts(float(mass), len(joints), followers, len(world.actuators), len(bodies))


def source_check(world: World, oracle: Oracle, notes: tuple[ImportNote, ...]) -> Check:
    """Number of joints and total mass against the source; what the importer repaired is named."""
    entity = next(e for e in world.entities if e.name == NAME)
    joints = entity.joint_stop - entity.joint_start
    mass = sum(body.inertial.mass for body in world.bodies[entity.body_start : entity.body_stop])
    if oracle.joints is None or oracle.mass is None:
        return Check("source", None, words=f"there is no file to compare with ({oracle.name})")
    off = abs(mass - oracle.mass) / max(oracle.mass, 1e-9)
    repaired = [str(note) for note in notes if note.kind == "repaired"]
    frozen = sum(note.kind == "dropped" and note.where.startswith("joint ") for note in notes)
    words: list[str] = []
    if joints + frozen != oracle.joints:
        words.append(f"{joints} joints, and {oracle.joints} in the source as {oracle.name} reads it")
    given = sum(float(found[1]) for note in notes if (found := GIVEN.search(note.message)))
    as_told = given > 0 and abs(mass - oracle.mass - given) <= ROUNDED * given
    invented = repaired and (0 < mass - oracle.mass < VIRTUAL or as_told)
    if off > MASS and not invented:
        words.append(f"{mass:.6g} kg, and {oracle.mass:.6g} kg in the source as {oracle.name} reads it")
    if words:
        return Check("source", False, off, "", MASS, "; ".join([*words, *repaired[:3]]))
    fixed = f" ({frozen} that move no mass are frozen)" * bool(frozen)
    told = f"{joints} joints{fixed}, {mass:.4g} kg" + (f"; repaired: {listing(repaired, 3)}" if repaired else "")
    return Check("source", True, off, "", None if invented else MASS, told)


def audit_check(engine: SimEngine) -> Check:
    """Everything that the engine reports of the world, held against the world."""
    lines = [line for line in audit(engine) if line.ok is not None]
    wrong = [line for line in lines if not line.ok]
    declared = sorted({line.quantity for line in lines if line.note})
    told = f"{len(lines)} numbers read back" + (
        f", within what the engine declares of {listing(declared)}" * bool(declared)
    )
    if wrong:
        first = [f"{x.quantity} of {x.subject}: {_numbers(x.found)}, should be {_numbers(x.expected)}" for x in wrong]
        told = listing(first, 3)
    return Check("audit", not wrong, float(len(wrong)), "numbers differ", 0.0, told)


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(f"{value:.6g}" for value in values)


def kinematics_check(engine: SimEngine, oracle: Oracle) -> Check:
    """The engine's own link frames at random joint positions, relative to the root, against the oracle's."""
    world = engine.world
    entity = next(e for e in world.entities if e.name == NAME)
    joints = range(entity.joint_start, entity.joint_stop)
    names = [world.joints[j].name.removeprefix(f"{NAME}.") for j in joints]
    frames = _frames(world, oracle, dict.fromkeys(names, 0.0))
    if not frames:
        return Check("kinematics", False, words=f"no link of the world is known to {oracle.name} by its name")
    rng = np.random.default_rng(0)
    worst, where = 0.0, ""
    for _ in range(CONFIGURATIONS if names else 1):
        q = _random_positions(world, oracle, names, rng)
        if names:
            leaders = [j for j in joints if world.joints[j].mimic is None]
            engine.set_joint_state([q[leaders]], np.zeros((1, len(leaders))), env_ids=[0], joints=leaders)
        poses = engine.get_state().body_pose[0]
        wanted = oracle.frames({name: float(q[j]) for name, j in zip(names, joints, strict=True)})
        root = P.inverse(poses[entity.root])
        origin = P.inverse(wanted[oracle.root]) if oracle.root in wanted else None
        for link, frame in frames.items():
            found = P.compose(root, P.compose(poses[frame.body], P.pose(frame.position, frame.quaternion)))
            target = wanted[link] if origin is None else P.compose(origin, wanted[link])
            distance = float(P.norm(found[:3] - target[:3])) / max(1.0, float(P.norm(target[:3])))
            if not distance <= worst:
                worst, where = distance, link
    engine.reset([0])
    words = f"{len(frames)} links at {CONFIGURATIONS} configurations against {oracle.name}"
    return Check(
        "kinematics", bool(worst <= FRAMES), worst, "m", FRAMES, words if worst <= FRAMES else f"{where} of {words}"
    )


def _frames(world: World, oracle: Oracle, still: dict[str, float]) -> dict[str, FixedFrame]:
    """The links that both know."""
    entity = next(e for e in world.entities if e.name == NAME)
    bodies = range(entity.body_start, entity.body_stop)
    ours = {world.bodies[b].name for b in bodies} | {site.name for site in world.sites if site.body in bodies}
    return {link: find_frame(world, f"{NAME}.{link}") for link in oracle.frames(still) if f"{NAME}.{link}" in ours}


def _random_positions(world: World, oracle: Oracle, names: list[str], rng: np.random.Generator) -> Array:
    """(J,) within the limits; what follows another in the World or in the source does so."""
    # a metre is far enough for what slides without end: engines of single precision read frames further out less well
    far = np.array([1.0 if joint.type is JointType.PRISMATIC else np.pi for joint in world.joints])
    lower = np.maximum([joint.lower for joint in world.joints], -far)
    upper = np.minimum([joint.upper for joint in world.joints], far)
    q = lower + (upper - lower) * rng.random(len(lower))
    entity = next(e for e in world.entities if e.name == NAME)
    place = {name: entity.joint_start + i for i, name in enumerate(names)}
    for name, follower in oracle.followers.items():
        if name in place and follower.leader in place:
            q[place[name]] = follower.multiplier * q[place[follower.leader]] + follower.offset
    for i, joint in enumerate(world.joints):
        if joint.mimic is not None:
            q[i] = joint.mimic.multiplier * q[joint.mimic.joint] + joint.mimic.offset
    return q
