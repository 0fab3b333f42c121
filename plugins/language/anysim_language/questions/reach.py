"""Questions about what an arm reaches from where its robot stands, by inverse kinematics within the joints' limits."""

from collections.abc import Iterator

import numpy as np

from anysim import registry
from anysim.conventions import IDENTITY_QUATERNION, Array
from anysim.kinematics.chain import Chain
from anysim.math import pose as P
from anysim.model.parts import ORIGIN
from anysim.model.world import Robot
from anysim.planning.api import inverse_kinematics
from anysim_language.questions.question import Asker, Question

SOLVER = "numpy_ik"
"""It compiles nothing, and where no package brings it nothing is asked."""
CHANNEL = "arm"
RESTARTS = 24
ROOM, SHORT = 0.030, 0.060
"""[m] What is within reach is so when moved by the first along any axis, what is not is missed by the second."""
SMALL = 400
"""A thing that is asked about is at most so long [mm]: the middle of a room is no place to reach for."""


def about_reach(asker: Asker) -> Iterator[Question]:
    """Every robot with an arm, and each small thing: its middle, by any of the robot's tools, in any orientation."""
    if SOLVER not in registry.names("planners"):
        return
    things = [thing for thing in asker.objects if max(thing.size) <= SMALL]
    for robot in asker.episode.world.robots:
        chains = chains_of(asker, robot)
        if not chains or robot.name not in asker.moment.by_name or not things:
            continue
        middles = np.array([asker.moment.at(thing.name) for thing in things]) / 1000.0
        room, short = _reached(asker, chains, middles)
        for thing, sure, missed in zip(things, room, short, strict=True):
            if sure or missed:
                program = {"robot": robot.name, "thing": thing.name}
                words = {"robot": asker.naming.the(robot.name), "thing": asker.naming.the(thing.name)}
                answer = "yes" if sure else "no"
                yield asker.ask("reachability", answer, program, (robot.name, thing.name), **words)


def chains_of(asker: Asker, robot: Robot) -> list[Chain]:
    """The arm under each tool of a robot; none for a robot without an arm."""
    world = asker.episode.world
    channel = robot.channels.get(CHANNEL)
    found: list[Chain] = []
    for tool in robot.tools if channel is not None else ():
        above: set[int] = set()
        body = world.sites[robot.tools[tool]].body
        while body >= 0:
            above.add(world.body_joint[body])
            body = world.bodies[body].parent
        joints = [j for j in channel.joints if j in above] if channel is not None else []
        if joints:
            found.append(Chain.from_world(world, robot.name, CHANNEL, tool, joints=joints))
    return found


def _reached(asker: Asker, chains: list[Chain], middles: Array) -> tuple[Array, Array]:
    """(n,) bool each: what a tool reaches with room to spare, and what every tool misses by far."""
    offsets = np.concatenate([np.zeros((1, 3)), ROOM * np.eye(3), -ROOM * np.eye(3)])
    places = (middles[:, None] + offsets).reshape(-1, 3)
    targets = np.concatenate([places, np.tile(IDENTITY_QUATERNION, (len(places), 1))], axis=1)
    room, short = np.zeros(len(middles), dtype=bool), np.ones(len(middles), dtype=bool)
    for chain in chains:
        seeds = asker.episode.joint_pos[asker.step, chain.joints]
        found = inverse_kinematics(chain, SOLVER).solve(
            targets,
            np.tile(_base(asker, chain, seeds), (len(targets), 1)),
            np.tile(seeds, (len(targets), 1)),
            random_restarts=RESTARTS,
            rng_seeds=np.arange(len(targets), dtype=np.uint64),
            rotation_weight=(0.0, 0.0, 0.0),
        )
        room |= found.converged.reshape(len(middles), -1).all(axis=1)
        short &= (found.position_error.reshape(len(middles), -1) >= SHORT)[:, 0]
    return room, short


def _base(asker: Asker, chain: Chain, joint_pos: Array) -> Array:
    """The pose (7,) of the chain's root under which its last link is where it is, however the joints between stand."""
    body = asker.episode.world.joints[int(chain.joints[-1])].body
    still = P.pose(ORIGIN, IDENTITY_QUATERNION)
    last = P.compose(chain.tool_pose(still, joint_pos), P.inverse(chain.tool_offset))
    return P.compose(asker.moment.poses[body], P.inverse(last))
