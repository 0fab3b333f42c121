"""Recorded bits: pick_cube's trajectories are, to the bit, those of the versions that recorded them.

What `pick_cube.json` holds was written by `python -m tests.runtime.test_pick_cube_bits`; a change of it is a change of
every recording and belongs into the changelog. Bits depend on the processor and on the libraries, so they are compared
where both are those of the file; elsewhere the numbers are compared, within what engines differ by between machines.
"""

import hashlib
import json
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_engine
from tests.task.helpers import arm

FILE = Path(__file__).with_name("pick_cube.json")
LIBRARIES = {"mujoco": "mujoco", "pybullet": "pybullet", "sapien": "sapien"}
STEPS = 100
"""Reach, grasp and the beginning of the lift: contact is in it."""


def machine(engine: str) -> str:
    """The processor's instruction sets and the libraries that compute, as one hash."""
    features = np.lib.introspect.opt_func_info(func_name="^(add|sqrt)$")
    parts = [platform.machine(), repr(features)]
    parts += [f"{name} {version(name)}" for name in ("numpy", "numba", LIBRARIES[engine])]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def rounded(value: Any) -> Any:
    """Numbers to nine digits, in whatever they stand; words as they are."""
    if isinstance(value, np.ndarray | list | tuple):
        return [rounded(part) for part in value]
    return round(float(value), 9) if isinstance(value, float | np.floating) else value


def measured(engine: str) -> dict[str, Any]:
    """Two envs with the task's expert: a hash of every action and state, where the cube ends, and what was drawn."""
    seen = hashlib.sha256()
    with arm(2, engine=engine) as env:
        policy = SkillPolicy(env)
        env.reset(seed=1)
        policy.begin(np.arange(2))
        for _ in range(STEPS):
            action = policy.act(np.arange(2))
            env.step(action)
            state = env.engine.get_state()
            for rows in (action, state.joint_pos, state.joint_vel, state.body_pose, env.obs["policy"]):
                seen.update(np.ascontiguousarray(rows).tobytes())
        cube = env.engine.get_state().body_pose[:, env.engine.index.body("cube"), :3]
        drawn = [{name: rounded(value) for name, value in sorted(one.items())} for one in env.streams.draws]
    return {
        "machine": machine(engine),
        "bits": seen.hexdigest(),
        "cube": np.round(cube, 6).tolist(),
        "draws": hashlib.sha256(json.dumps(drawn).encode()).hexdigest(),
    }


@pytest.mark.parametrize("engine", sorted(LIBRARIES))
def test_trajectories_are_those_that_were_recorded(engine: str) -> None:
    require_engine(engine)
    wanted, found = json.loads(FILE.read_text())[engine], measured(engine)
    assert found["draws"] == wanted["draws"], "a stream has another name, or a draw moved"
    np.testing.assert_allclose(found["cube"], wanted["cube"], atol=2e-3)
    if found["machine"] == wanted["machine"]:
        assert found["bits"] == wanted["bits"], "recordings of earlier versions no longer replay to the bit"


if __name__ == "__main__":
    FILE.write_text(json.dumps({engine: measured(engine) for engine in sorted(LIBRARIES)}, indent=1) + "\n")
