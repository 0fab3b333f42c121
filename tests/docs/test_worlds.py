"""The example worlds: on every engine that can run them, with the same things at the same places."""

from pathlib import Path

import numpy as np
import pytest

import anysim
from anysim.errors import CapabilityError
from anysim.testing.engines import require_engine

ALL = sorted((Path(__file__).parents[2] / "docs" / "worlds").glob("*.yaml"))
WORLDS = [path for path in ALL if path.stem != "fifteen_families"]
"""Those that the kinematic engine runs too; the other one has tests of its own."""
BIG = {"mujoco": ("team",), "pybullet": ("team", "thousand"), "sapien": ("thousand",)}
"""The engines, and for each the large worlds that the slow tier tries on it."""


def start(world: Path, engine: str, num_envs: int = 2) -> dict[str, np.ndarray]:
    """What is present in the first episodes, where, and where it is two control steps later."""
    cameras = anysim.load(world).spec.world.cameras
    blind = [f"world.cameras.{name}.channels=[]" for name in cameras] if engine == "null" else []
    with anysim.make(world, engine=engine, num_envs=num_envs, overrides=blind) as env:
        env.reset(seed=1)
        pose = env.engine.get_state().body_pose.copy()
        env.engine.step(4)
        later = env.engine.get_state()
        assert not later.fault.any()
        assert np.isfinite(later.body_pose).all()
        return {"presence": env.engine.presence, "pose": pose, "later": later.body_pose.copy()}


@pytest.mark.parametrize(
    ("world", "engine"),
    [
        pytest.param(path, engine, id=f"{path.stem}-{engine}", marks=[pytest.mark.slow] if path.stem in slow else [])
        for path in WORLDS
        for engine, slow in BIG.items()
    ],
)
def test_a_world_runs_on_every_engine_that_declares_it_can(world: Path, engine: str) -> None:
    require_engine(engine)
    try:
        found = start(world, engine)
    except CapabilityError as error:
        pytest.skip(str(error))
    wanted = start(world, "null")
    assert (found["presence"] == wanted["presence"]).all()
    assert np.allclose(found["pose"], wanted["pose"], atol=1e-5)
    # nothing is pushed apart that was placed: in 20 ms things fall by at most 2 mm
    assert np.abs(found["later"][..., :3] - found["pose"][..., :3]).max() < 4e-3


def test_the_eight_are_there() -> None:
    assert [path.stem for path in ALL] == [
        "cluttered_table",
        "fifteen_families",
        "four_worlds",
        "kitchen",
        "room",
        "rough_terrain",
        "team",
        "thousand",
    ]
