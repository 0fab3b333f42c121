"""Properties of a simulator, under the names that legged-gym code has for them."""

from abc import ABC, abstractmethod
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.errors import TaskError
from anysim_legged_gym.control import Drives
from anysim_legged_gym.depth import DepthCamera
from anysim_legged_gym.drawing import Viewer
from anysim_legged_gym.ground import Ground
from anysim_legged_gym.layout import Layout
from anysim_legged_gym.moment import Moment
from anysim_legged_gym.randomization import DomainRandomization
from anysim_legged_gym.spec import LeggedSpec


class LastValues(NamedTuple):
    """Quantities before the last step; zeros for an env that was reset since."""

    actions: Array
    dof_pos: Array
    dof_vel: Array
    torques: Array
    base_lin_vel: Array
    base_ang_vel: Array
    feet_vel: Array

    @classmethod
    def zeros(cls, envs: int, dofs: int, feet: int) -> Self:
        joints, vectors = (lambda: np.zeros((envs, dofs))), (lambda: np.zeros((envs, 3)))
        return cls(joints(), joints(), joints(), joints(), vectors(), vectors(), np.zeros((envs, feet, 3)))

    def without(self, ids: Array) -> Self:
        """The same, with zeros for these envs."""
        rows = [array.copy() for array in self]
        for array in rows:
            array[ids] = 0.0
        return type(self)(*rows)


class Readings(ABC):
    """The properties of `LeggedSimulator`: N envs, D joints, B links, F feet, P points of heights.

    Joints and links are in the World's order on every engine, and there is one order: contact forces have the order of
    links. Arrays stay as they are when the engine moves on.
    """

    cfg: LeggedSpec
    engine: SimEngine
    layout: Layout
    ground: Ground
    base_init_pos: Array
    base_init_quat: Array
    default_dof_pos: Array
    _drives: Drives
    _random: DomainRandomization
    _depth: DepthCamera | None
    _viewer: Viewer
    _last: LastValues

    @property
    @abstractmethod
    def moment(self) -> Moment:
        """All quantities of now."""

    # ------------------------------------------------------------------ sizes and names

    @property
    def num_envs(self) -> int:
        return self.engine.num_envs

    @property
    def num_dof(self) -> int:
        return len(self.layout.dof_names)

    @property
    def num_actions(self) -> int:
        return self.num_dof

    @property
    def num_bodies(self) -> int:
        return len(self.layout.body_names)

    @property
    def dof_names(self) -> tuple[str, ...]:
        return self.layout.dof_names

    @property
    def body_names(self) -> tuple[str, ...]:
        return self.layout.body_names

    @property
    def feet_names(self) -> tuple[str, ...]:
        return self.layout.feet_names

    @property
    def dt(self) -> float:
        """[s] from action to action."""
        return self.cfg.sim.dt * self.cfg.control.decimation

    @property
    def feet_indices(self) -> Array:
        """(F,) the links that carry the feet, among `body_names`."""
        return self.layout.feet_indices

    @property
    def feet_contact_indices(self) -> Array:
        """(F,) the same among the rows of `link_contact_forces`."""
        return self.layout.feet_indices

    @property
    def termination_contact_indices(self) -> Array:
        """(K,) rows of `link_contact_forces` that end an episode."""
        return self.layout.termination_indices

    @property
    def penalized_contact_indices(self) -> Array:
        """(K,) rows of `link_contact_forces` that are penalized."""
        return self.layout.penalized_indices

    # ------------------------------------------------------------------ the base

    @property
    def base_pos(self) -> Array:
        """(N, 3) [m] world frame."""
        return self.moment.base_pos

    @property
    def base_quat(self) -> Array:
        """(N, 4) xyzw, w not negative."""
        return self.moment.base_quat

    @property
    def base_euler(self) -> Array:
        """(N, 3) [rad] roll, pitch, yaw about fixed axes, in [-pi, pi]."""
        return self.moment.base_euler

    @property
    def base_lin_vel(self) -> Array:
        """(N, 3) [m/s] of the base frame's origin, in the base frame."""
        return self.moment.in_base[:, 0]

    @property
    def base_ang_vel(self) -> Array:
        """(N, 3) [rad/s] in the base frame."""
        return self.moment.in_base[:, 1]

    @property
    def base_lin_vel_w(self) -> Array:
        """(N, 3) [m/s] world frame."""
        return self.moment.base_lin_vel_w

    @property
    def base_ang_vel_w(self) -> Array:
        """(N, 3) [rad/s] world frame."""
        return self.moment.base_ang_vel_w

    @property
    def projected_gravity(self) -> Array:
        """(N, 3) unit, where gravity points to, in the base frame."""
        return self.moment.in_base[:, 2]

    # ------------------------------------------------------------------ joints

    @property
    def dof_pos(self) -> Array:
        """(N, D) [rad]."""
        return self.moment.dof_pos

    @property
    def dof_vel(self) -> Array:
        """(N, D) [rad/s]."""
        return self.moment.dof_vel

    @property
    def torques(self) -> Array:
        """(N, D) [N m] that the drives exerted in the last physics step, clipped; zeros after a reset."""
        return self.moment.torques

    @cached_property
    def dof_pos_limits(self) -> Array:
        """(D, 2) [rad] lower and upper."""
        joints = self.engine.world.joints
        return np.array([(joints[j].lower, joints[j].upper) for j in self.layout.joints])

    @cached_property
    def dof_vel_limits(self) -> Array:
        """(D,) [rad/s]."""
        return np.array([self.engine.world.joints[j].velocity_limit for j in self.layout.joints])

    @cached_property
    def torque_limits(self) -> Array:
        """(D,) [N m]."""
        return np.array([self.engine.world.actuators[a].effort_limit for a in self.layout.drives])

    @cached_property
    def p_gains(self) -> Array:
        """(D,) as built: of positions in control P, of velocities in V; 0 in T."""
        drives = [self.engine.world.actuators[a] for a in self.layout.drives]
        kind = self.cfg.control.control_type
        return np.array([{"P": d.kp, "V": d.kd, "T": 0.0}[kind] for d in drives])

    @cached_property
    def d_gains(self) -> Array:
        """(D,) as built, of velocities in control P; 0 in V and T."""
        drives = [self.engine.world.actuators[a] for a in self.layout.drives]
        return np.array([d.kd if self.cfg.control.control_type == "P" else 0.0 for d in drives])

    @property
    def actions(self) -> Array:
        """(N, D) that acted in the last step: clipped, and late where there is a delay."""
        return self._drives.actions.copy()

    @property
    def action_delay(self) -> Array:
        """(N,) actions by which an action is late."""
        return self._drives.delay.copy()

    # ------------------------------------------------------------------ links and feet

    @property
    def feet_pos(self) -> Array:
        """(N, F, 3) [m] world frame."""
        return self.moment.feet[0]

    @property
    def feet_vel(self) -> Array:
        """(N, F, 3) [m/s] world frame."""
        return self.moment.feet[1]

    @property
    def key_body_pos(self) -> Array:
        """(N, K, 3) [m] of `asset.key_bodies`, world frame."""
        return self.moment.key_body_pos

    @property
    def link_contact_forces(self) -> Array:
        """(N, B, 3) [N] net force on each link in the last physics step, friction included, world axes."""
        return self.moment.link_contact_forces

    @property
    def link_contact_states(self) -> Array:
        """(N, B) bool: more than 1 N."""
        return self.moment.link_contact_states

    # ------------------------------------------------------------------ ground

    @property
    def measured_heights(self) -> Array:
        """(N, P) [m] of the ground at `height_points` beside the base, world frame."""
        return self.moment.measured_heights

    @property
    def height_points(self) -> Array:
        """(P, 2) [m] ahead and to the left of the base, turning with its heading."""
        return self.ground.points

    @property
    def heights_around_feet(self) -> Array:
        """(N, F, 9) [m] of the ground within 5 cm of each foot, world frame."""
        return self.moment.heights_around_feet

    @property
    def terrain_types(self) -> Array:
        """(N,) the column of each env's tile."""
        return self.ground.types.copy()

    @property
    def terrain_levels(self) -> Array:
        """(N,) the row of each env's tile; a level that was changed counts from the env's next reset on."""
        return self.ground.levels.copy()

    @property
    def max_terrain_level(self) -> int:
        """How many levels there are."""
        return len(self.ground.origins)

    @property
    def terrain_origins(self) -> Array:
        """(levels, types, 3) [m] where robots begin on each tile."""
        return self.ground.origins

    @property
    def env_origins(self) -> Array:
        """(N, 3) [m] where each env's robot begins; every env has the world to itself."""
        return self.ground.env_origins

    # ------------------------------------------------------------------ before the last step

    @property
    def last_actions(self) -> Array:
        return self._last.actions

    @property
    def last_dof_pos(self) -> Array:
        return self._last.dof_pos

    @property
    def last_dof_vel(self) -> Array:
        return self._last.dof_vel

    @property
    def last_torques(self) -> Array:
        return self._last.torques

    @property
    def last_base_lin_vel(self) -> Array:
        return self._last.base_lin_vel

    @property
    def last_base_ang_vel(self) -> Array:
        return self._last.base_ang_vel

    @property
    def last_feet_vel(self) -> Array:
        return self._last.feet_vel

    # ------------------------------------------------------------------ pictures

    @property
    def depth_images(self) -> Array:
        """(N, H, W) float32 [m] of the last `update_sensors`; of an env that was reset since, of its new state.

        Raises:
            TaskError: there is no depth camera.
        """
        if self._depth is None:
            raise TaskError("this simulator has no depth camera; make it with `depth: {source: rays}`")
        return self._depth.images

    @property
    def viewer_image(self) -> Array | None:
        """(H, W, 3) uint8, the last picture of the viewer; None before the first."""
        return self._viewer.image

    # ------------------------------------------------------------------ what differs between envs

    @property
    def dr_friction_values(self) -> Array:
        """(N, 1) factor of all surfaces."""
        return self._random.drawn.friction.copy()

    @property
    def dr_restitution_values(self) -> Array:
        """(N, 1) of all surfaces."""
        return self._random.drawn.restitution.copy()

    @property
    def dr_added_base_mass(self) -> Array:
        """(N, 1) [kg] added to the base."""
        return self._random.drawn.added_base_mass.copy()

    @property
    def dr_base_com_bias(self) -> Array:
        """(N, 3) [m] in the base frame."""
        return self._random.drawn.base_com_bias.copy()

    @property
    def dr_joint_armature(self) -> Array:
        """(N, D) [kg m^2]."""
        return self._random.drawn.joint_armature.copy()

    @property
    def dr_kp_scale(self) -> Array:
        """(N, D) factor of `p_gains`."""
        return self._random.drawn.kp_scale.copy()

    @property
    def dr_kd_scale(self) -> Array:
        """(N, D) factor of `d_gains`."""
        return self._random.drawn.kd_scale.copy()
