"""Velocity tracking as legged-gym code has it: observations, rewards, falls and commands on a simulator."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim_legged_gym.simulator import LeggedSimulator

CLOCK = 2.5
"""[1/s] strides of the trot that is rewarded."""
DUTY = 0.55
"""Share of a stride that a foot stands."""
CLEARANCE = 0.06
"""[m] that a swinging foot is rewarded for."""
HEIGHT_RANGE = 1.0
"""[m] to which heights below the base are clipped."""


class Transition(NamedTuple):
    """What a step gave. Rows of `done` envs are observations after the reset."""

    observation: Array
    """(N, O) float32"""
    reward: Array
    """(N,)"""
    done: Array
    """(N,) bool: fell, or the time is over"""
    late: Array
    """(N,) bool: the time is over"""


class VelocityEnv:
    """A quadruped that follows commands (vx, vy, yaw rate), rewarded for a trot; episodes reset by themselves.

    Attributes:
        commands: (N, 3) [m/s, m/s, rad/s] in the base frame.
        walked: (N,) [m] by which each env is away from where its episode began.
    """

    def __init__(self, simulator: LeggedSimulator, *, episode: float = 20.0, heights: bool = False) -> None:
        """`episode` [s] is the longest one; with `heights` the ground is observed, and levels follow what is walked."""
        if len(simulator.feet_names) != 4:
            raise TaskError(f"a trot has four feet, and '{simulator.cfg.asset.robot}' {len(simulator.feet_names)}")
        self.simulator, self._heights = simulator, heights
        n, self._limit = simulator.num_envs, round(episode / simulator.dt)
        self.commands = np.zeros((n, 3))
        self._ticks, self._episodes = np.zeros(n, dtype=int), np.zeros(n, dtype=int)
        place = simulator.feet_pos[0, :, :2] - simulator.base_pos[0, :2]
        self._offset = np.where((place[:, 0] > 0) == (place[:, 1] > 0), 0.0, 0.5)  # diagonal pairs in turn
        world = simulator.engine.world
        joints = [world.joints[j] for j in simulator.layout.joints]
        turns = world.initial_body_pose[[joint.body for joint in joints], 3:]
        axes = P.rotate(turns, np.array([joint.axis for joint in joints]))
        self._hips = np.flatnonzero(np.abs(axes[:, 0]) > 0.9)
        self._radius = float(np.min(simulator.feet_pos[..., 2] - simulator.heights_around_feet[..., 4]))
        self._stand = float(simulator.base_init_pos[2]) - 0.03
        self._every = np.arange(n)
        self._begin(self._every)
        self.observation = self._observe()

    @property
    def walked(self) -> Array:
        return np.linalg.norm(self.simulator.base_pos[:, :2] - self.simulator.env_origins[:, :2], axis=1)

    def step(self, actions: Array) -> Transition:
        """Take actions (N, D), reward what came of them, and begin new episodes where one ended."""
        sim = self.simulator
        sim.step(actions)
        sim.post_physics_step()
        self._ticks += 1
        fallen = (sim.projected_gravity[:, 2] > -0.5) | sim.engine.get_state().fault
        late = self._ticks >= self._limit
        reward = 0.1 * np.maximum(self._reward(), 0.0) - 0.5 * fallen
        done = fallen | late
        ended = np.flatnonzero(done)
        if len(ended):
            self._climb(ended)
            sim.reset_idx(ended)
            self._begin(ended)
        self.observation = self._observe()
        return Transition(self.observation, reward, done, late & ~fallen)

    def _begin(self, ids: Array) -> None:
        self._ticks[ids] = 0
        self._episodes[ids] += 1
        for env in ids:
            stream = self.simulator.streams.shared_generator(int(env), "legged/command", int(self._episodes[env]))
            self.commands[env] = stream.uniform([-0.5, -0.4, -1.0], [1.0, 0.4, 1.0]) * (stream.uniform() > 0.1)

    def _climb(self, ended: Array) -> None:
        """Up where half a tile was walked, down where less than half of what was commanded."""
        sim = self.simulator
        if not (self._heights and sim.ground.tiled):
            return
        walked, size = self.walked[ended], sim.cfg.terrain.surface.tiling.size
        wanted = np.linalg.norm(self.commands[ended, :2], axis=1) * self._ticks[ended] * sim.dt
        up = walked > size / 2
        sim.update_terrain_curriculum(ended, up, ~up & (walked < wanted / 2))

    # ------------------------------------------------------------------ what is seen and rewarded

    def _phase(self) -> Array:
        """(N, F) of each foot in its stride, in [0, 1); it stands up to `DUTY`."""
        return (self._ticks[:, None] * (self.simulator.dt * CLOCK) + self._offset) % 1.0

    def _observe(self) -> Array:
        sim = self.simulator
        clock = 2 * np.pi * self._ticks * (sim.dt * CLOCK)
        parts = [
            2.0 * sim.base_lin_vel,
            0.25 * sim.base_ang_vel,
            sim.projected_gravity,
            self.commands * [2.0, 2.0, 1.0],
            sim.dof_pos - sim.default_dof_pos,
            0.05 * sim.dof_vel,
            sim.actions,
            np.sin(clock)[:, None],
            np.cos(clock)[:, None],
        ]
        if self._heights:
            below = sim.base_pos[:, 2:] - self._stand - sim.measured_heights
            parts.append(np.clip(below, -HEIGHT_RANGE, HEIGHT_RANGE))
        return np.concatenate(parts, axis=1, dtype=np.float32, casting="same_kind")

    def _reward(self) -> Array:
        """(N,) of research on trotting policies: tracking, calm, posture, and feet in time with the clock."""
        sim = self.simulator
        linear, angular, gravity = sim.base_lin_vel, sim.base_ang_vel, sim.projected_gravity
        off = sim.dof_pos - sim.default_dof_pos
        feet, speed = sim.feet_pos, sim.feet_vel
        ground = sim.heights_around_feet[..., 4]
        touch, phase = sim.link_contact_states[:, sim.feet_contact_indices], self._phase()
        stand = phase < DUTY
        swing = (phase - DUTY) / (1.0 - DUTY)
        wanted = self._radius + CLEARANCE * np.sin(np.pi * swing) ** 2
        short = np.where(stand, 0.0, feet[..., 2] - ground - wanted)
        slip = np.where(touch, np.square(speed[..., :2]).sum(axis=-1), 0.0)
        low = sim.base_pos[:, 2] - ground.mean(axis=1) - self._stand
        return (
            1.5 * np.exp(-_squares(self.commands[:, :2] - linear[:, :2]) / 0.15)
            + 0.75 * np.exp(-np.square(self.commands[:, 2] - angular[:, 2]) / 0.25)
            - 2.0 * np.square(linear[:, 2])
            - 0.05 * _squares(angular[:, :2])
            - 2.5 * _squares(gravity[:, :2])
            - 2e-4 * _squares(sim.torques)
            - 0.01 * _squares(sim.actions - sim.last_actions)
            - 20.0 * np.square(low)
            - 0.1 * slip.sum(axis=1)
            - 0.05 * _squares(off)
            - 0.3 * _squares(off[:, self._hips])
            + 0.25
            + 0.4 * (touch == stand).mean(axis=1)
            - 20.0 * _squares(short)
        )


def _squares(rows: Array) -> Array:
    return np.einsum("nk,nk->n", rows, rows)
