"""The drives: u = kp (q* - q) + kd (qd* - qd) + ff, clipped, with its damping taken implicitly.

Each substep kp (q* - q) + kd qd* + ff goes into PhysX as a force, and the damping as PhysX' own drive, a constraint
that the solver meets together with contacts and limits. So a free joint moves as MuJoCo's `implicitfast` moves it, and
a blocked one exerts all of its command; a law computed outside from mass matrix and bias alone would lose most of it.
Where the law exceeds the effort limit the force is the limit itself and the drive's damping is off. This holds for the
PGS solver: TGS applies forces at once and damping bit by bit, and damped joints get much too slow.
"""

import numpy as np

from anysim.conventions import Array
from anysim.engine.commands import MODES, Control
from anysim.errors import EngineError
from anysim.world.model import ControlMode, World
from anysim_sapien.journal import Journal, Op
from anysim_sapien.scene import UNBOUNDED, EnvScene

_POSITION, _EFFORT = MODES.index(ControlMode.POSITION), MODES.index(ControlMode.EFFORT)


class Drives:
    """Gains, limits (N, A), passive damping (N, J), and the terms of the law per joint (N, J)."""

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
        self._push = np.zeros((n, len(joints)))
        self._stiffness = np.zeros((n, len(joints)))
        self._damping = np.zeros((n, len(joints)))
        self._bound = np.full((n, len(joints)), np.inf)
        self._set = np.full((n, len(joints)), np.nan)  # the damping that PhysX has
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
        for array in (self._push, self._stiffness, self._damping):
            array[...] = 0.0
        self._bound[...] = np.inf
        if self._control is None or not len(self._joint):
            return
        position, velocity, effort, mode = self._control
        kp, kd = self.kp * (mode == _POSITION), self.kd * (mode != _EFFORT)
        self._push[:, self._joint] = kp * position + kd * velocity + effort
        self._stiffness[:, self._joint], self._damping[:, self._joint] = kp, kd
        self._bound[:, self._joint] = self.limit

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
        self._set[env] = np.nan

    def given(self, env: int) -> Array:
        """The damping (J,) that PhysX has of an env; not a number where it has none yet."""
        return self._set[env].copy()

    def adopt(self, env: int, damping: Array) -> None:
        """The env's scene is another one, which was given this."""
        self._set[env] = damping

    def substep(self, env: int, scene: EnvScene) -> None:
        """Give PhysX the law's terms at the present state."""
        law, push = self._law(env, scene.joint_positions(), scene.joint_velocities())
        bound = self._bound[env]
        over = np.abs(law) > bound
        damping = self.passive[env] + np.where(over, 0.0, self._damping[env])
        force = np.where(over, np.clip(law, -bound, bound), push)
        changed = damping != self._set[env]
        if changed.any():
            for index in np.flatnonzero(changed):
                scene.joints[index].set_drive_properties(0.0, float(damping[index]), UNBOUNDED, "force")
            self._set[env] = damping
        for tree in scene.trees:
            tree.handle.set_qf(force[tree.joints].astype(np.float32))
        self._over, self._force, self._given = over, force, push

    def _law(self, env: int, position: Array, velocity: Array) -> tuple[Array, Array]:
        """The law with its damping at the present speed, and without (J,)."""
        push = self._push[env] - self._stiffness[env] * position
        return push - self._damping[env] * velocity, push

    def note(self, env: int, scene: EnvScene) -> None:
        """Keep what the last substep's drives exerted: their damping acted on the speed at its end."""
        bound = self._bound[env]
        smooth = np.clip(self._given - self._damping[env] * scene.joint_velocities(), -bound, bound)
        self.effort[env] = np.where(self._over, self._force, smooth)
