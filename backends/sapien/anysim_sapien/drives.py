"""The drives: u = kp (q* - q) + kd (qd* - qd) + ff, clipped, with its damping taken implicitly.

Each substep kp (q* - q) + kd qd* + ff goes into PhysX as a force, and the damping as PhysX' own drive, a constraint
that the solver meets together with contacts and limits. So a free joint moves as MuJoCo's `implicitfast` moves it, and
a blocked one exerts all of its command; a law computed outside from mass matrix and bias alone would lose most of it.
Where the law exceeds the effort limit at the present speed, PhysX clips it instead, at the speed that it ends with: the
drive gets the law as damping towards a velocity, and the limit. A clipped force given from outside would set stiff
joints swinging. With `actuation: explicit_pd` the force is the law of the state at the beginning of the substep. This
holds for the PGS solver: TGS applies forces at once and damping bit by bit, and damped joints get much too slow.

See `anysim_sapien.kernels.substep` for the law.
"""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.control import EFFORT, POSITION, Control
from anysim.errors import EngineError
from anysim.model.world import Actuation, World
from anysim_sapien.journal import Journal, Op
from anysim_sapien.packing import Packing
from anysim_sapien.scene import UNBOUNDED, EnvScene


class _Ended(NamedTuple):
    """What an env's efforts are worked out from: the law of its last substep, and the state that it left."""

    law: Array
    packed: bytes
    packing: Packing


class Drives:
    """Gains, limits (N, A), passive damping (N, J), and the law of each joint (N, 8, J)."""

    each_substep = True
    """Whether `substep` must be called before each substep, and not only `begin` before the first."""

    def __init__(self, world: World, num_envs: int) -> None:
        from anysim_sapien import kernels  # numba, where a world is built

        actuators, joints, n = world.actuators, world.joints, num_envs
        driven = [a.joint for a in actuators]
        for actuator in actuators:
            if driven.count(actuator.joint) > 1:
                raise EngineError(f"joint '{joints[actuator.joint].name}' has two drives; sapien takes one per joint")
        self._kernels = kernels
        self._actuator = np.array([driven.index(j) if j in driven else -1 for j in range(len(joints))], dtype=int)
        self.kp = np.tile(np.array([a.kp for a in actuators], dtype=float), (n, 1))
        self.kd = np.tile(np.array([a.kd for a in actuators], dtype=float), (n, 1))
        self.limit = np.tile(np.array([a.effort_limit for a in actuators], dtype=float), (n, 1))
        self.passive = np.tile(np.array([j.damping for j in joints], dtype=float), (n, 1))
        self._control = np.zeros((n, 0))  # the commands, a row per env
        self._commanded, self._tuned = 0, 0  # how often commands, and gains, were written
        self._kind = {Actuation.EXPLICIT_PD: kernels.EXPLICIT, Actuation.NATIVE: kernels.NATIVE}.get(
            world.physics.actuation, kernels.LAW
        )
        limits = [j.velocity_limit if world.physics.velocity_limits else np.inf for j in joints]
        self._speeds = np.array(limits, dtype=float)
        # damping, force limit and velocity target of PhysX' drives, as PhysX has them
        self._told = np.full((n, 3, len(joints)), np.nan)
        self._news = np.zeros((len(joints), 2), dtype=int)
        self._ended: list[_Ended | None] = [None] * n
        self._update()

    def apply(self, control: Control) -> None:
        """Take over the commands of all envs."""
        self._control = np.concatenate(control, axis=1)
        self._commanded += 1
        self._update()

    def refresh(self) -> None:
        """Take over gains, limits or passive damping that were written."""
        self._tuned += 1
        self._update()

    def _update(self) -> None:
        """Make the law: a new array, since efforts of the last substep may yet be asked for."""
        self._law = np.empty((len(self._control), 8, len(self._actuator)))
        self._kernels.orders(
            self._control,
            self._actuator,
            self.kp,
            self.kd,
            self.limit,
            self.passive,
            self._speeds,
            POSITION,
            EFFORT,
            self._law,
        )

    def set_gains(self, env: int, values: Array) -> None:
        """Write an env's kp, kd, limits (A,) and passive damping (J,), one after the other."""
        a = self.kp.shape[1]
        self.kp[env], self.kd[env], self.limit[env] = values[: 3 * a].reshape(3, a)
        self.passive[env] = values[3 * a :]
        self.refresh()

    def record(self, env: int, journal: Journal) -> None:
        """Have a journal know what moves the env from here on."""
        if journal.commanded != self._commanded:
            journal.commanded = self._commanded
            control = self._control[env].tobytes()
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
        count, kernel = 0, self._kernels.substep
        for handle, _, joints, force in scene.trees:
            count = kernel(
                self._law,
                env,
                joints,
                handle.get_qpos(),
                handle.get_qvel(),
                self._kind,
                UNBOUNDED,
                self._told,
                force,
                self._news,
                count,
            )
            handle.set_qf(force)
        if count:
            self._tell(env, scene, count)

    def _tell(self, env: int, scene: EnvScene, count: int) -> None:
        damping, limit, target = self._told[env].tolist()
        for j, what in self._news[:count].tolist():
            if what & self._kernels.GAINS:
                scene.joints[j].set_drive_properties(0.0, damping[j], limit[j], "force")
            if what & self._kernels.SPEED:
                scene.joints[j].set_drive_velocity_target(target[j])

    # ------------------------------------------------------------------ what was exerted

    def note(self, env: int, scene: EnvScene) -> None:
        """After the last substep: the drives' damping acted on the speed at its end. Most steps are never asked for."""
        self._ended[env] = _Ended(self._law, scene.packed(), scene.packing)

    def exerted(self, env: int, effort: Array) -> None:
        """Write what the env's drives exerted in the last substep into its row of (N, J)."""
        ended = self._ended[env]
        if ended is not None:
            law, packed, packing = ended
            state = np.frombuffer(packed, dtype=np.float32)
            self._kernels.exerted(law, env, state, packing.joint_pos, packing.joint_vel, self._kind, effort)
