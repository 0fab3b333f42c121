"""Mobile manipulators stand at home, wheels on the ground, for five seconds on every engine."""

import numpy as np
import pytest

from anysim.api import compile_world, load
from anysim.engine.factory import create_simulation
from tests.tiers import by_turns

ROBOTS = ("tiago", "tiago_dual", "tiago_pro", "pr2", "mobile_panda", "mobile_dual_panda", "mobile_ur5")
SAG, MOVED = 0.05, 0.01  # [rad] or [m]; [m] of the base


@pytest.mark.parametrize(("robot", "engine"), by_turns(ROBOTS))
def test_it_stands(robot: str, engine: str) -> None:
    world = compile_world(
        load({"engine": engine, "world": {"name": "w", "terrain": "plane", "robots": {"r": {"robot": robot}}}})
    )
    wheels = {i for i, joint in enumerate(world.joints) if "wheel" in joint.name}
    held = sorted({a.joint for a in world.actuators} - wheels)
    with create_simulation(engine) as simulation:
        simulation.create_world(world, 1)
        simulation.reset()
        simulation.set_control(position=np.array([[world.joints[a.joint].initial for a in world.actuators]]))
        start = simulation.get_state()
        home, place = start.joint_pos[0, held].copy(), start.body_pose[0, 0, :3].copy()
        for _ in range(20):
            simulation.step(round(0.25 / world.physics.dt))
            state = simulation.get_state()
            off = np.abs(state.joint_pos[0, held] - home)
            worst = int(off.argmax())
            assert off[worst] <= SAG, f"{world.joints[held[worst]].name} is {off[worst]:.3f} off"
            assert np.abs(state.body_pose[0, 0, :3] - place).max() <= MOVED
            assert np.abs(state.joint_vel[0, held]).max() <= 1.0
