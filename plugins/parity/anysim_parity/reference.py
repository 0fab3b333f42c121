"""The solution of the drive law, engine-free: what every engine approximates in steps of its own.

The equations of motion with u = clip(kp (q* - q) - kd v) are integrated with the two-stage Rosenbrock method ROS2
(Verwer et al. 1999), of second order and stable for stiff gains. On a Panda halving its step changes the solution by a
fiftieth of the tolerance that it serves.
"""

import numpy as np

from anysim.conventions import Array
from anysim.model.world import ControlMode, World
from anysim_parity.mechanism import Mechanism
from anysim_parity.tape import Tape

GAMMA = 1.0 - 1.0 / np.sqrt(2.0)


def no_reference(world: World) -> str:
    """Why a world's drive law has no reference solution here; empty where it has."""
    if world.tendons or world.constraints or any(joint.friction > 0 for joint in world.joints):
        return "dry friction has no smooth law, nor have tendons and constraints, so there is no reference solution"
    if any(a.mode is ControlMode.VELOCITY for a in world.actuators):
        return "the tape holds velocity drives still, so there is no reference solution"
    return ""


def drive_solution(world: World, tape: Tape, step: float | None = None) -> Array:
    """Joint positions (T, J) after each control step, of mechanisms on held bases that touch nothing.

    Args:
        world: mechanisms alone; limits are not met.
        tape: the targets.
        step: of the integration [s]; half of that of the physics where it is None.
    """
    law = _Law(world)
    control_dt = world.physics.control_dt
    count = max(1, round(control_dt / (step or world.physics.dt / 2)))
    q = np.array([world.joints[i].initial for i in law.leaders])
    v = np.zeros(len(q))
    rows = []
    for target in tape.targets:
        for _ in range(count):
            q, v = law.advance(q, v, target, control_dt / count)
        rows.append(law.all(q))
    return np.array(rows)


class _Law:
    """The equations of motion of the joints that follow no other."""

    def __init__(self, world: World) -> None:
        joints, drives = world.joints, world.actuators
        self._mechanism = Mechanism(world)
        self.leaders = [i for i, joint in enumerate(joints) if joint.mimic is None]
        self._couple, self._offset = np.zeros((len(joints), len(self.leaders))), np.zeros(len(joints))
        for i in range(len(joints)):
            leader, factor = i, 1.0
            while (mimic := joints[leader].mimic) is not None:
                self._offset[i] += factor * mimic.offset
                factor *= mimic.multiplier
                leader = mimic.joint
            self._couple[i, self.leaders.index(leader)] = factor
        self._joint = np.array([a.joint for a in drives], dtype=int)
        position = np.array([a.mode is ControlMode.POSITION for a in drives], dtype=float)
        self._kp = np.array([a.kp for a in drives]) * position
        self._kd = np.array([a.kd for a in drives]) * position
        self._limit = np.array([a.effort_limit for a in drives])
        self._damping, *self._spring = np.reshape([(j.damping, j.stiffness, j.spring_rest) for j in joints], (-1, 3)).T

    def all(self, q: Array) -> Array:
        """Positions of all joints (J,) from those of the leaders."""
        return self._couple @ q + self._offset

    def advance(self, q: Array, v: Array, target: Array, h: float) -> tuple[Array, Array]:
        """One step of ROS2 on (q, v), with the Jacobian of drives and damping alone."""
        mass, force, stiff, damp = self._terms(q, v, target)
        # (1 - g h J) k = f with f = (v, M^-1 F) and J = [[0, 1], [-M^-1 K, -M^-1 D]], the first half eliminated
        g = GAMMA * h
        matrix = mass + g * damp + g * g * stiff

        def stage(rate: Array, effort: Array) -> tuple[Array, Array]:
            push = np.linalg.solve(matrix, effort - g * stiff @ rate)
            return rate + g * push, push

        kq, kv = stage(v, force)
        mass2, force2, *_ = self._terms(q + h * kq, v + h * kv, target)
        # the second stage: f(y + h k1) - 2 k1, where the force of the other place is seen through its own mass
        effort = mass @ np.linalg.solve(mass2, force2) - 2.0 * mass @ kv
        lq, lv = stage(v + h * kv - 2.0 * kq, effort)
        return q + h * (1.5 * kq + 0.5 * lq), v + h * (1.5 * kv + 0.5 * lv)

    def _terms(self, q: Array, v: Array, target: Array) -> tuple[Array, Array, Array, Array]:
        """Mass, force, and minus its derivatives by q and v, all of the leaders."""
        c = self._couple
        full, rate = self.all(q), c @ v
        mass, bias = self._mechanism.equations(full, rate)
        wanted = self._kp * (target - full[self._joint]) - self._kd * rate[self._joint]
        free = np.abs(wanted) < self._limit  # a drive at its limit neither stiffens nor damps
        stiff, damp = self._spring[0].copy(), self._damping.copy()
        np.add.at(stiff, self._joint, self._kp * free)
        np.add.at(damp, self._joint, self._kd * free)
        effort = -bias - self._damping * rate - self._spring[0] * (full - self._spring[1])
        np.add.at(effort, self._joint, np.clip(wanted, -self._limit, self._limit))
        return c.T @ mass @ c, c.T @ effort, (c.T * stiff) @ c, (c.T * damp) @ c
