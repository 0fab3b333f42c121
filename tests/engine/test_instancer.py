"""Hundreds of equal bodies from one declaration, on every engine."""

import numpy as np
import pytest

from anysim.compile.world import compile_world
from anysim.engine.factory import create_simulation, runnable
from anysim.model.world import World
from anysim_schemas.run import WorldSpec

RADIUS, MASS = 0.02, 0.01


def heap(count: int) -> World:
    """Balls that fall into a tray with low walls."""
    walls = {
        f"wall{i}": {"source": {"box": size}, "fixed": True}
        for i, size in enumerate([[0.5, 0.02, 0.1]] * 2 + [[0.02, 0.5, 0.1]] * 2)
    }
    places = [(0, 0.25), (0, -0.25), (0.25, 0), (-0.25, 0)]
    balls = {"source": {"sphere": RADIUS}, "family": "rigid_instancer", "count": count, "mass": MASS}
    return compile_world(
        WorldSpec.model_validate(
            {
                "objects": {"balls": balls, **walls},
                "layout": {f"wall{i}": {"position": [*place, 0.05]} for i, place in enumerate(places)},
            }
        )
    )


@pytest.mark.parametrize(
    "engine", [pytest.param(name, marks=pytest.mark.slow) if name == "mujoco" else name for name in runnable()]
)
def test_two_hundred_bodies_are_built_fall_and_lie(engine: str) -> None:
    world = heap(200)
    with create_simulation(engine) as simulation:
        simulation.create_world(world)
        start = simulation.get_state().body_pose[0, :200, :3].copy()
        assert np.allclose(start, world.initial_body_pose[:200, :3], atol=1e-6)
        if "body.mass" in simulation.parameters:
            assert np.allclose(simulation.get_parameters("body.mass", indices=range(200)), MASS)
        if engine == "null":  # nothing falls there
            return
        simulation.step(500)
        place = simulation.get_state().body_pose[0, :200, :3]
        # nobody has sunk into the ground by more than a tenth of the radius, nor left the tray of half a metre
        assert place[:, 2].min() > 0.9 * RADIUS
        assert np.abs(place[:, :2]).max() < 0.26
        assert place[:, 2].mean() < start[:, 2].mean() - RADIUS
        apart = np.linalg.norm(place[:, None] - place[None], axis=-1) + np.eye(200)
        assert apart.min() > 1.8 * RADIUS
        saved = simulation.snapshot()
        simulation.reset()
        assert np.allclose(simulation.get_state().body_pose[0, :200, :3], start, atol=1e-6)
        simulation.restore(saved)
        assert np.allclose(simulation.get_state().body_pose[0, :200, :3], place, atol=1e-6)
