"""The hand with several fingers that grasps are tried with: that of a robot of the catalogue, without its arm."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from anysim.api import compile_world
from anysim.assets.model import ImportedModel
from anysim.conventions import Array
from anysim.errors import AssetError, listing
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.frames import find_frame
from anysim.model.hash import FORMAT, world_hash
from anysim.model.world import Actuator, BodyKind, World
from anysim_banks.pieces import Piece, piece_of

ROBOT = "robot"


@dataclass(frozen=True, eq=False)
class Hand:
    """A hand, as `anysim_banks.method.Tool` has it.

    Attributes:
        name: of the robot in the catalogue.
        model: what its tool is on and all that that carries.
        actuators: of its K drives, their joints numbered as the model's.
        tool: (7,) in the root's frame: z out of the palm, y along the fingers.
        joints: (K,) their names.
        opened: (K,) [rad].
        synergies: postures (K,) by name.
        finger: (K,) the finger of each drive, -1: none.
        finger_of: (B,) of each body, -1: none.
        pieces: what collides of it with open fingers, in the tool's frame.
        hash: a digest of all this.
    """

    name: str
    model: ImportedModel
    actuators: tuple[Actuator, ...]
    tool: Array
    joints: tuple[str, ...]
    opened: Array
    synergies: Mapping[str, Array]
    finger: Array
    finger_of: Array
    pieces: tuple[Piece, ...]
    hash: str


def hand(name: str, tool: str = "tool", channel: str = "eef") -> Hand:
    """The hand of a robot of the catalogue.

    Raises:
        AnysimError: there is no such robot.
        AssetError: its channel has no fingers with postures.
    """
    world = compile_world({"world": {"robots": {ROBOT: {"robot": name}}}})
    robot = world.robots[0]
    known = robot.entry.channels.get(channel) if robot.entry is not None else None
    if known is None or not known.groups or not known.synergies or robot.channels[channel].opened is None:
        raise AssetError(
            f"'{name}' is neither a procedural gripper nor a robot of the catalogue whose channel '{channel}' has "
            "fingers: `groups`, and the postures `opened` and `synergies`"
        )
    frame, drives = find_frame(world, f"{ROBOT}.{tool}"), robot.channels[channel]
    bodies = list(world.carried_by(frame.body))
    number = {body: i for i, body in enumerate(bodies)}
    joints = [j for j, joint in enumerate(world.joints) if joint.body in number and joint.body != frame.body]
    if missing := [world.joints[j].name for j in drives.joints if j not in joints]:
        raise AssetError(f"the tool '{tool}' of '{name}' does not carry its fingers: {listing(missing)}")
    root = replace(world.bodies[frame.body], parent=-1, kind=BodyKind.STATIC)
    parts = [root, *(replace(world.bodies[b], parent=number[world.bodies[b].parent]) for b in bodies[1:])]
    geoms = tuple(replace(g, body=number[g.body]) for g in world.geoms if g.body in number and g.collides)
    used = {getattr(geom.shape, "mesh", "") for geom in geoms}
    model = ImportedModel(
        name,
        tuple(_named(part) for part in parts),
        tuple(_named(replace(world.joints[j], body=number[world.joints[j].body])) for j in joints),
        tuple(_named(geom) for geom in geoms),
        tuple("" for _ in geoms),
        meshes=tuple(mesh for mesh in world.meshes if mesh.name in used),
        links={"": 0},
        excluded_pairs=frozenset((number[a], number[b]) for a, b in world.excluded_pairs if {a, b} <= set(number)),
    )
    local = tuple(world.joints[world.actuators[a].joint].name.removeprefix(f"{ROBOT}.") for a in drives.actuators)
    actuators = tuple(
        replace(world.actuators[a], joint=joints.index(world.actuators[a].joint)) for a in drives.actuators
    )
    owner = {joint: f for f, group in enumerate(known.groups.values()) for joint in group}
    finger = np.array([owner.get(joint, -1) for joint in local])
    opened = np.array(drives.opened, dtype=float)
    at = np.array([*frame.position, *frame.quaternion])
    digest = world_hash(World(FORMAT, bodies=model.bodies, joints=model.joints, geoms=model.geoms, actuators=actuators))
    return Hand(
        name,
        model,
        actuators,
        at,
        local,
        opened,
        {key: np.array(q, dtype=float) for key, q in known.synergies.items()},
        finger,
        _fingers(world, bodies, {j: int(f) for j, f in zip(drives.joints, finger, strict=True)}),
        _opened(world, bodies, dict(zip(drives.joints, opened.tolist(), strict=True)), frame.body, at),
        digest,
    )


def _named(part: Any) -> Any:
    return replace(part, name=part.name.removeprefix(f"{ROBOT}").removeprefix("."))


def _fingers(world: World, bodies: list[int], finger: dict[int, int]) -> Array:
    found: dict[int, int] = {}
    for body in bodies:
        found[body] = finger.get(world.body_joint[body], found.get(world.bodies[body].parent, -1))
    return np.array([found[body] for body in bodies])


def _opened(world: World, bodies: list[int], opened: dict[int, float], root: int, tool: Array) -> tuple[Piece, ...]:
    joint_pos = np.array([[opened.get(j, joint.initial) for j, joint in enumerate(world.joints)]])
    poses = forward_kinematics(world, world.initial_body_pose[None], joint_pos)[0]
    to_tool = P.inverse(P.compose(poses[root], tool))
    found: list[Piece] = []
    for body in bodies:
        for geom in (g for g in world.body_geoms[body] if world.geoms[g].collides):
            piece = piece_of(world, geom)
            if piece is not None:
                found.append(piece._replace(pose=P.compose(P.compose(to_tool, poses[body]), piece.pose)))
    return tuple(found)
