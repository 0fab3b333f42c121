"""Parameters that sensors need of an engine: as they are in each env, or as the World says."""

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.parameters import nominal


def parameter(engine: SimEngine, name: str, env_ids: Array, which: Array) -> Array:
    """Values (n, K, ...) for the things `which` (K,) in these envs; those of the World where the engine has no such."""
    if name in engine.parameters:
        return engine.get_parameters(name, env_ids, which)
    rows = nominal(name, engine.world)[which]
    return np.broadcast_to(rows, (len(env_ids), *rows.shape))


def gravity(engine: SimEngine, env_ids: Array) -> Array:
    """(n, 3) [m/s^2], which may differ between envs."""
    return parameter(engine, "world.gravity", env_ids, np.array([0]))[:, 0]
