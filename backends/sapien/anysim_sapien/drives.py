"""The drives: u = kp (q* - q) + kd (qd* - qd) + ff, clipped, with its damping taken implicitly.

Each substep kp (q* - q) + kd qd* + ff goes into PhysX as a force, and the damping as PhysX' own drive, a constraint
that the solver meets together with contacts and limits. So a free joint moves as MuJoCo's `implicitfast` moves it, and
a blocked one exerts all of its command; a law computed outside from mass matrix and bias alone would lose most of it.
Where the law exceeds the effort limit at the present speed, PhysX clips it instead, at the speed that it ends with: the
drive gets the law as damping towards a velocity, and the limit. A clipped force given from outside would set stiff
joints swinging. With `actuation: explicit_pd` the force is the law of the state at the beginning of the substep. This
holds for the PGS solver: TGS applies forces at once and damping bit by bit, and damped joints get much too slow.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.engine.control import MODES, Control
from anysim.engine.drive_checks import speed_bound
from anysim.errors import EngineError
from anysim.model.world import Actuation, ControlMode, World
from anysim_sapien.journal import Journal, Op
from anysim_sapien.scene import UNBOUNDED, EnvScene, velocities_of

_POSITION, _EFFORT = MODES.index(ControlMode.POSITION), MODES.index(ControlMode.EFFORT)


class Drives:
    """Gains, limits (N, A), passive damping (N, J), and the terms of the law per joint (N, J)."""

    each_substep = True
    """Whether `substep` must be called before each substep, and not only `begin` before the first."""

    def __init__(self, world: World, num_envs: int) -> None:
        actuators, joints, n = world.actuators, world.joints, num_envs
        driven = [a.joint for a in actuators]
        for actuator in actuators:
            if driven.count(actuator.joint) > 1:
                raise EngineError(f"joint '{joints[actuator.joint].name}' has two drives; sapien takes one per joint")
        self._joint = np.array([a.joint for a in actuators], dtype=int)
        self._mode = np.tile(np.array([MODES.index(a.mode) for a in actuators], dtype=np.int8), (n, 1))
        self.kp = np.tile(np.array([a.kp for a in actuators], dtype=float), (n, 1))
        self.kd = np.tile(np.array([a.kd for a in actuators], dtype=float), (n, 1))
        self.limit = np.tile(np.array([a.effort_limit for a in actuators], dtype=float), (n, 1))
        self.passive = np.tile(np.array([j.damping for j in joints], dtype=float), (n, 1))
        self._control: Control | None = None
        self._packed = np.zeros((n, 0))  # the same numbers, a row per env
        self._commanded, self._tuned = 0, 0  # how often commands, and gains, were written
        self._explicit = world.physics.actuation is Actuation.EXPLICIT_PD
        limits = [j.velocity_limit if world.physics.velocity_limits else np.inf for j in joints]
        self._speeds = np.array(limits, dtype=float)
        self._push = np.zeros((n, len(joints)))
        self._feed = np.zeros((n, len(joints)))
        self._asked = np.full((n, len(joints)), np.inf)  # bounds what the position and velocity targets ask for
        self._stiffness = np.zeros((n, len(joints)))
        self._damping = np.zeros((n, len(joints)))
        self._bound = np.full((n, len(joints)), np.inf)
        self._given = np.zeros((n, len(joints)))
        # damping, force limit and velocity target of PhysX' drives: as they are to be, and as PhysX has them
        self._terms = np.zeros((n, 3, len(joints)))
        self._told = np.full((n, 3, len(joints)), np.nan)
        self.effort = np.zeros((n, len(joints)))
        """What the drives exerted in the last substep (N, J)."""

    def apply(self, control: Control) -> None:
        """Take over the commands of all envs."""
        self._packed = np.concatenate(control, axis=1)
        self._control = Control(*np.split(self._packed, 4, axis=1))
        self._commanded += 1
        self._update()

    def refresh(self) -> None:
        """Take over gains, limits or passive damping that were written."""
        self._tuned += 1
        self._update()

    def _update(self) -> None:
        """Make the terms of the law."""
        for array in (self._push, self._feed, self._stiffness, self._damping):
            array[...] = 0.0
        self._bound[...] = np.inf
        if self._control is None or not len(self._joint):
            return
        position, velocity, effort, mode = self._control
        kp, kd = self.kp * (mode == _POSITION), self.kd * (mode != _EFFORT)
        self._push[:, self._joint] = kp * position + kd * velocity
        self._feed[:, self._joint] = effort
        self._stiffness[:, self._joint], self._damping[:, self._joint] = kp, kd
        self._bound[:, self._joint] = self.limit
        self._asked = speed_bound(self._damping, self._speeds)

    def set_gains(self, env: int, values: Array) -> None:
        """Write an env's kp, kd, limits (A,) and passive damping (J,), one after the other."""
        a = len(self._joint)
        self.kp[env], self.kd[env], self.limit[env] = values[: 3 * a].reshape(3, a)
        self.passive[env] = values[3 * a :]
        self.refresh()

    def record(self, env: int, journal: Journal) -> None:
        """Have a journal know what moves the env from here on."""
        if journal.commanded != self._commanded:
            journal.commanded = self._commanded
            control = self._packed[env].tobytes()
            if control != journal.control:
                journal.control = control
                journal.record(Op.CONTROL, control)
        if journal.tuned != self._tuned:
            journal.tuned = self._tuned
            gains = b"".join(part[env].tobytes() for part in (self.kp, self.kd, self.limit, self.passive))
            if gains != journal.gains:
                journal.gains = gains
                journal.record(Op.GAINS, gains)

    def forget(self, env: int) -> None:
        """The env's scene is new: PhysX has none of these numbers."""
        self._told[env] = np.nan

    def begin(self, env: int, scene: EnvScene) -> None:
        """Before the first substep of a call: nothing, the law is given anew in each."""

    def given(self, env: int) -> Array:
        """What PhysX has been told of an env's drives; not a number where it has been told nothing yet."""
        return self._told[env].copy()

    def adopt(self, env: int, told: Array) -> None:
        """The env's scene is another one, which was told this."""
        self._told[env] = told

    def substep(self, env: int, scene: EnvScene) -> None:
        """Give PhysX the law's terms at the present state."""
        velocity = scene.joint_velocities()
        law, push = self._law(env, scene.joint_positions(), velocity)
        bound = self._bound[env]
        over = np.abs(law) > bound
        terms = self._terms[env]
        terms[0], terms[1], terms[2] = self.passive[env], UNBOUNDED, 0.0
        if self._explicit:
            force = np.clip(law, -bound, bound)
        else:
            terms[0] += self._damping[env]
            force = push
            if over.any():
                force = self._limited(env, over, push, law, velocity, terms)
        changed = terms != self._told[env]
        if changed.any():
            self._tell(scene, changed, terms)
            self._told[env] = terms
        for tree in scene.trees:
            tree.handle.set_qf(force[tree.joints].astype(np.float32))
        self._given[env] = force if self._explicit else push

    def _limited(self, env: int, over: Array, push: Array, law: Array, velocity: Array, terms: Array) -> Array:
        """The forces (J,) where drives exceed their limits; writes into `terms` what makes PhysX clip the others."""
        bound, passive = self._bound[env], self.passive[env]
        clipped = over & (self._damping[env] > 0)
        terms[1, clipped] = np.maximum(bound - np.sign(law) * passive * velocity, 0.0)[clipped]
        terms[2, clipped] = push[clipped] / terms[0, clipped]
        return np.where(over, np.where(clipped, 0.0, np.clip(push, -bound, bound)), push)

    def _tell(self, scene: EnvScene, changed: Array, terms: Array) -> None:
        damping, limit, target = terms.tolist()
        changed = changed & scene.layout.joint_there
        for j in np.flatnonzero(changed[0] | changed[1]).tolist():
            scene.joints[j].set_drive_properties(0.0, damping[j], limit[j], "force")
        for j in np.flatnonzero(changed[2]).tolist():
            scene.joints[j].set_drive_velocity_target(target[j])

    def _law(self, env: int, position: Array, velocity: Array) -> tuple[Array, Array]:
        """The law with its damping at the present speed, and without (J,)."""
        asked = self._asked[env]
        push = np.clip(self._push[env] - self._stiffness[env] * position, -asked, asked) + self._feed[env]
        return push - self._damping[env] * velocity, push

    def note(self, envs: Any, scenes: Sequence[EnvScene]) -> None:
        """Of some envs, keep what the last substep's drives exerted: their damping acted on the speed at its end."""
        bound, given = self._bound[envs], self._given[envs]
        if not self._explicit:
            given = given - self._damping[envs] * velocities_of(scenes)
        self.effort[envs] = np.clip(given, -bound, bound)
