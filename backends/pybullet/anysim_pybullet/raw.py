"""Bullet's own loop over the same envs, which the engine is measured against."""

from collections.abc import Callable
from dataclasses import replace
from itertools import cycle
from weakref import finalize

import numpy as np

from anysim.engine.control import Control, alternating
from anysim.engine.state import SnapshotLevel
from anysim.model.world import Actuation
from anysim_pybullet.bullet import bullet
from anysim_pybullet.envs import Envs


def raw_loop(envs: Envs, control: Control) -> Callable[[int], None]:
    """A function of the number of physics steps: set targets, step private clients, copy the state out into arrays.

    As one would write it for Bullet alone: its own motors, told once in a call (gains are arguments of Bullet's call,
    so that they are told with each target); the torques that carry a gravity
    compensated robot in every step, as Bullet wants them, but not worked out anew; positions and velocities of joints,
    and poses and velocities of centres of mass, as Bullet gives them.

    Raises:
        EngineError: the world asks for what Bullet's motors cannot do.
    """
    p, n = bullet(), len(envs.clients)
    world = replace(envs.world, physics=replace(envs.world.physics, actuation=Actuation.NATIVE))
    copy = Envs(world, np.array([env.cast.present for env in envs.clients]), envs.plan.options)
    for i in range(n):
        rows = {name: np.asarray(row) for name, row in envs.rows(i, SnapshotLevel.TRAJECTORY).items()}
        copy.put_rows(i, rows, SnapshotLevel.TRAJECTORY)
    laws = copy.laws
    laws.apply(control)
    turns = cycle([_orders(copy, commands) for commands in alternating(control)])
    for i in range(n):
        copy.step(i, 1)
    lifted = [
        [
            (env.root_ids[t.number], env.tree_links[t.number], laws.lift.torque[i, t.joints].tolist())
            for t in env.cast.trees
            if laws.lifts[t.number]
        ]
        for i, env in enumerate(copy.clients)
    ]
    linked = [[t for t in env.cast.trees if len(t.joints)] for env in copy.clients]
    joints, bodies = len(world.joints), len(world.bodies)
    position, velocity = np.zeros((n, joints)), np.zeros((n, joints))
    pose, twist = np.zeros((n, bodies, 7)), np.zeros((n, bodies, 6))

    def loop(steps: int) -> None:
        orders = next(turns)
        for i, env in enumerate(copy.clients):
            client = env.id
            for uid, links, terms in orders[i]:
                p.setJointMotorControlArray(uid, links, p.POSITION_CONTROL, **terms, physicsClientId=client)
            for _ in range(steps):
                for uid, links, torque in lifted[i]:
                    p.setJointMotorControlArray(uid, links, p.TORQUE_CONTROL, forces=torque, physicsClientId=client)
                p.stepSimulation(physicsClientId=client)
            for t in linked[i]:
                uid, links = env.root_ids[t.number], env.tree_links[t.number]
                states = p.getJointStates(uid, links, physicsClientId=client)
                position[i, t.joints] = [s[0] for s in states]
                velocity[i, t.joints] = [s[1] for s in states]
                read = p.getLinkStates(
                    uid, links, computeLinkVelocity=1, computeForwardKinematics=1, physicsClientId=client
                )
                pose[i, t.bodies[1:]] = [(*s[0], *s[1]) for s in read]
                twist[i, t.bodies[1:]] = [(*s[6], *s[7]) for s in read]
            for number, body in env.cast.free:
                uid = env.root_ids[number]
                place, turn = p.getBasePositionAndOrientation(uid, physicsClientId=client)
                linear, angular = p.getBaseVelocity(uid, physicsClientId=client)
                pose[i, body], twist[i, body] = (*place, *turn), (*linear, *angular)

    finalize(loop, copy.close)
    return loop


def _orders(envs: Envs, control: Control) -> list[list[tuple[int, list[int], dict[str, list[float]]]]]:
    """What Bullet's motors are told, env by env: body, links, targets and gains of each articulation."""
    laws, orders = envs.laws, [[] for _ in envs.clients]
    number_of = {env.id: i for i, env in enumerate(envs.clients)}
    if laws.motors is not None:
        for client, uid, links, terms in laws.motors.orders(control):
            orders[number_of[client]].append((uid, links, terms))
    return orders
