"""Bullet's own loop over the same envs, which the engine is measured against."""

from collections.abc import Callable, Mapping
from weakref import finalize

import numpy as np

from anysim.conventions import Array
from anysim.engine.state import SnapshotLevel
from anysim_pybullet.bullet import bullet
from anysim_pybullet.envs import Envs


def raw_loop(envs: Envs) -> Callable[[int], None]:
    """A function of the number of physics steps: write torques, step private clients, copy the state out.

    The torques are those of the last step, written in every step as Bullet wants it; nothing is computed.
    """
    p, ids = bullet(), np.arange(len(envs.clients))
    copy = Envs(envs.world, len(envs.clients), envs.plan.options)
    state: Mapping[str, Array] = envs.snapshot(ids, SnapshotLevel.TRAJECTORY)
    copy.restore(ids, state, SnapshotLevel.TRAJECTORY)
    robots = [t for t in envs.plan.trees if len(t.joints)]
    free = [t.number for t in envs.plan.trees if t.free]
    torques = [[envs.laws.effort[i, t.joints].tolist() for t in robots] for i in ids]

    def loop(steps: int) -> None:
        for index, env in enumerate(copy.clients):
            links = [[env.joint_link[j] for j in t.joints.tolist()] for t in robots]
            for _ in range(steps):
                for t, where, torque in zip(robots, links, torques[index], strict=True):
                    p.setJointMotorControlArray(
                        env.root_ids[t.number], where, p.TORQUE_CONTROL, forces=torque, physicsClientId=env.id
                    )
                p.stepSimulation(physicsClientId=env.id)
            for t, where in zip(robots, links, strict=True):
                p.getJointStates(env.root_ids[t.number], where, physicsClientId=env.id)
                p.getLinkStates(env.root_ids[t.number], where, computeLinkVelocity=1, physicsClientId=env.id)
            for number in free:
                p.getBasePositionAndOrientation(env.root_ids[number], physicsClientId=env.id)
                p.getBaseVelocity(env.root_ids[number], physicsClientId=env.id)

    finalize(loop, copy.close)
    return loop
