"""Simulators for tests: a Go1 with soft legs."""

from collections.abc import Mapping
from typing import Any

import pytest

from anysim.testing.engines import require_engine
from anysim_legged_gym.simulator import LeggedSimulator

ENGINES = ("mujoco", "pybullet", "sapien")
ONE_FIRST = ("mujoco", *(pytest.param(name, marks=pytest.mark.slow) for name in ENGINES[1:]))
"""One engine in the fast tier: for what the interface does by means that the contract suite holds on every engine."""
SOFT: Mapping[str, Any] = {"stiffness": 40.0, "damping": 1.0}


def simulator(engine: str, num_envs: int = 2, **sections: Any) -> LeggedSimulator:
    require_engine(engine)
    control = {**SOFT, "decimation": 5, **sections.pop("control", {})}
    return LeggedSimulator({"sim": {"dt": 0.004}, "control": control, **sections}, engine, num_envs=num_envs)
