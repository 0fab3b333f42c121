"""Terms for whole families of tasks: `tasks.velocity`, `tasks.coverage`, `tasks.latch`, `tasks.spring` and others."""

from anysim_tasks.terms.climb import Climb
from anysim_tasks.terms.coverage import Coverage, CoverageGain
from anysim_tasks.terms.latch import Latch
from anysim_tasks.terms.spring import Spring
from anysim_tasks.terms.velocity import Velocity, at_velocity, goal_velocity, velocity_match

TERMS = {
    "observation": {"goal_velocity": goal_velocity},
    "reward": {"coverage_gain": CoverageGain, "velocity_match": velocity_match},
    "predicate": {"at_velocity": at_velocity, "coverage": Coverage},
    "command": {"velocity": Velocity},
    "event": {"climb": Climb, "latch": Latch, "spring": Spring},
}
