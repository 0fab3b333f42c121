"""Bullet's own drives, for `actuation: native`: a motor is a constraint on the joint's velocity with a bounded force.

A motor reaches v + g_p (q* - q) / dt + g_v (qd* - v) at the end of a step, whatever else acts on the joint, as long as
its force suffices. With g_p = dt^2 kp / D, g_v = dt (kd + d) / D and D = I + A + dt (kd + d) a single joint moves
as the drive law says; I is the joint's own entry in the mass matrix at the initial pose, A its armature, d its damping.
So a motor knows nothing of coupling and load, and one that is blocked pushes with up to its effort limit.
Feed-forward moves the target. Drives in effort mode have no motor and stay with the law, see `law`.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.control import Control, acting_gains
from anysim.errors import EngineError
from anysim.kinematics.dynamics import mass_matrix
from anysim.model.world import World
from anysim_mechanics.damped_drives import native_targets
from anysim_mechanics.drive_gains import DriveGains
from anysim_mechanics.trees import Tree
from anysim_pybullet.bullet import bullet
from anysim_pybullet.client import Env

ENDLESS = 1e30
"""Stands for no effort limit: Bullet multiplies it by the time step."""


class Motors:
    """The motors of all envs."""

    def __init__(self, world: World, trees: list[Tree], num_envs: int) -> None:
        self._dt = world.physics.dt
        self._driven = np.array([a.joint for a in world.actuators], dtype=int)
        for actuator in world.actuators:
            refuse_dry_friction(world, actuator.joint, world.joints[actuator.joint].friction)
        if len(set(self._driven.tolist())) < len(self._driven):
            raise EngineError(
                f"a joint of '{world.name}' has two drives; with physics.actuation: native pybullet has one motor per "
                f"joint; use physics.actuation: implicit_pd"
            )
        armature = np.array([joint.armature for joint in world.joints])
        diagonal = np.diag(mass_matrix(world, world.initial_body_pose))[: len(armature)]
        self._inertia = (diagonal - armature)[self._driven]
        self.running = np.zeros((num_envs, len(world.joints)), dtype=bool)
        """Which joints (N, J) a motor moves."""
        self._gains: _Gains | None = None
        self._modes = b""
        self._rows: list[tuple[int, Array, list[int]]] = []  # per tree with drives: number, actuators, joints
        for tree in trees:
            chosen = [a for a, joint in enumerate(self._driven.tolist()) if joint in tree.joints]
            if chosen:
                self._rows.append((tree.number, np.array(chosen), self._driven[chosen].tolist()))

    def know(self, mode: Array) -> bool:
        """Whether gains are kept for these modes (N, A); else `prepare` makes them."""
        return self._gains is not None and mode.tobytes() == self._modes

    def forget(self) -> None:
        """Gains were changed, or an env was built anew."""
        self._gains = None

    def apply(self, control: Control) -> None:
        """Give Bullet the targets and the kept gains of all envs."""
        p = bullet()
        for client, uid, links, terms in self.orders(control):
            p.setJointMotorControlArray(uid, links, p.POSITION_CONTROL, **terms, physicsClientId=client)

    def orders(self, control: Control) -> Iterator[tuple[int, int, list[int], dict[str, list[float]]]]:
        """What Bullet is to be told: client, body, links, targets and gains, for each articulation."""
        gains = self._gains
        assert gains is not None
        position, velocity = np.empty_like(control.position), np.empty_like(control.position)
        native_targets(*control[:3], gains.stiffness, gains.drag, gains.whole, position, velocity)
        places, speeds = position.tolist(), velocity.tolist()
        for order in gains.orders:
            place, speed = places[order.env], speeds[order.env]
            if order.actuators is not None:
                place, speed = [place[a] for a in order.actuators], [speed[a] for a in order.actuators]
            terms = {"targetPositions": place, "targetVelocities": speed, **order.terms}
            yield order.client, order.uid, order.links, terms

    def prepare(self, mode: Array, own: DriveGains, damping: Array, armature: Array, envs: list[Env]) -> None:
        """Keep all that does not depend on targets; the mode is (N, A), the joints' damping and armature are (N, J)."""
        dt = self._dt
        stiffness, drag = acting_gains(mode, own.kp, own.kd)
        motor = (stiffness > 0) | (drag > 0)
        whole = drag + damping[:, self._driven]
        inertia = self._inertia + armature[:, self._driven] + dt * whole
        self.running[:, self._driven] = motor
        told = {
            "forces": np.where(motor, np.minimum(own.limit, ENDLESS), 0.0),
            "positionGains": dt * dt * stiffness / inertia,
            "velocityGains": dt * whole / inertia,
        }
        orders: list[_Order] = []
        for number, chosen, joints in self._rows:
            some = None if len(chosen) == len(self._driven) else chosen.tolist()
            for index, env in enumerate(envs):
                if env.root_ids[number] >= 0:
                    terms = {name: values[index, chosen].tolist() for name, values in told.items()}
                    links = [env.joint_link[j] for j in joints]
                    orders.append(_Order(index, env.id, env.root_ids[number], links, some, terms))
        self._gains, self._modes = _Gains(stiffness, drag, whole, orders), mode.tobytes()


class _Order(NamedTuple):
    """What Bullet is told of an articulation besides targets; `actuators` None stands for all, in order."""

    env: int
    client: int
    uid: int
    links: list[int]
    actuators: list[int] | None
    terms: dict[str, list[float]]


class _Gains(NamedTuple):
    """Gains of the drives in their modes (N, A), their damping with that of their joints, and the orders made of it."""

    stiffness: Array
    drag: Array
    whole: Array
    orders: list[_Order]


def refuse_dry_friction(world: World, joint: int, friction: float) -> None:
    """Raise where a driven joint is to have dry friction: Bullet makes both of the same motor."""
    if friction > 0 and any(a.joint == joint for a in world.actuators):
        raise EngineError(
            f"joint '{world.joints[joint].name}' has dry friction and a drive; with physics.actuation: native pybullet "
            f"has one motor for both; use physics.actuation: implicit_pd, or take the friction away"
        )
