"""Terms for whole families of tasks: velocities and gaits of bases, `tasks.coverage`, `tasks.latch`, `tasks.spring`."""

from anysim_tasks.terms import base_motion, gait, generalized
from anysim_tasks.terms.bounded import at_least
from anysim_tasks.terms.climb import Climb
from anysim_tasks.terms.coverage import Coverage, CoverageGain
from anysim_tasks.terms.disturbance import Shove, com_offset, tip_over
from anysim_tasks.terms.latch import Latch
from anysim_tasks.terms.spring import Spring
from anysim_tasks.terms.velocity import Tracked, Velocity, at_velocity, goal_velocity, velocity_match

TERMS = {
    "observation": {
        "clock": gait.clock,
        "generalized_force": generalized.generalized_force,
        "generalized_position": generalized.generalized_position,
        "generalized_velocity": generalized.generalized_velocity,
        "goal_velocity": goal_velocity,
    },
    "reward": {
        "ang_vel_xy_l2": base_motion.ang_vel_xy_l2,
        "at_least": at_least,
        "base_height_l2": base_motion.base_height_l2,
        "coverage_gain": CoverageGain,
        "effort_share_l2": base_motion.EffortShareL2,
        "feet_slide": gait.feet_slide,
        "flat_orientation_l2": base_motion.flat_orientation_l2,
        "forward_speed": generalized.forward_speed,
        "gait_contact": gait.gait_contact,
        "joint_deviation_l2": base_motion.JointDeviationL2,
        "lin_vel_z_l2": base_motion.lin_vel_z_l2,
        "swing_height_l2": gait.swing_height_l2,
        "velocity_match": velocity_match,
    },
    "predicate": {
        "at_velocity": at_velocity,
        "base_sunk": base_motion.base_sunk,
        "coverage": Coverage,
        "tracked": Tracked,
    },
    "command": {"velocity": Velocity},
    "event": {
        "climb": Climb,
        "com_offset": com_offset,
        "latch": Latch,
        "shove": Shove,
        "spring": Spring,
        "tip_over": tip_over,
    },
}
