"""Two hands carry a tray: `pink_ik` solves both arms as one problem, and the hands keep their distance.

The robot's trunk is fixed. No tray is in contact: it is its weight, half of which pulls down at each hand, and its
stiffness is what is tested: how far the hands come from the places at its ends, as seen from each other. What other
channels move (fingers, a head) is held at home, and fingers that follow others have to follow throughout.
"""

from typing import Any

import numpy as np
import pytest

from anysim import registry
from anysim.controllers.base import ChannelView
from anysim.controllers.robot import ControlledRobot
from anysim.engine.factory import create_simulation
from anysim.math import pose as P
from anysim.testing.tracking import bolted, robot_world

ENGINES = ("mujoco", "pybullet", "sapien")
WEIGHT = 3.0
"""[N] of a tray of 0.3 kg, which the arms do not know of: their drives give way by what it takes."""


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("robot", ["unitree_g1", "baxter", "dual_ur5"])
def test_two_hands_carry_a_tray(robot: str, engine: str) -> None:
    world = bolted(robot_world(robot, position=[0.0, 0.0, 0.5]))
    seen = ControlledRobot(world, "robot")
    channel = world.robots[0].channels["arm"]
    view = ChannelView.of(world, channel, seen)
    made: Any = registry.load("controllers", "pink_ik")
    controller = made(view, 1, velocity_scale=0.5)
    with create_simulation(engine) as sim:
        sim.create_world(world, 1)
        sim.reset()
        seen.see(sim.get_state())
        home = np.array([[world.joints[a.joint].initial for a in world.actuators]])
        controller.reset(np.array([0]), home[:, view.actuators])
        base = seen.base_pose(None)
        start = np.concatenate(
            [P.compose(P.inverse(base), seen.frame_pose(None, tool)) for tool in controller._servo._frames.names]
        )
        hands = [seen._frame(tool)[0] for tool in controller._servo._frames.names]
        pull = np.zeros((1, 2, 6))
        pull[:, :, 2] = -0.5 * WEIGHT
        apart, off, lost = [], [], [0.0]
        followers = [(i, j.mimic) for i, j in enumerate(world.joints) if j.mimic is not None]
        wanted = P.compose(P.inverse(start[0]), start[1])
        for step in range(125):
            # up and forward by 8 cm and 10 cm, and to the side and back
            share = min(step * 0.02 / 1.5, 1.0)
            smooth = 3 * share**2 - 2 * share**3
            way = np.array([0.10 * smooth, 0.06 * np.sin(2 * np.pi * smooth), 0.08 * smooth])
            target = start.copy()
            target[:, :3] += way
            seen.see(sim.get_state())
            command = controller.apply(target.reshape(1, -1), None)
            position, velocity, effort = home.copy(), np.zeros_like(home), np.zeros_like(home)
            position[:, view.actuators], velocity[:, view.actuators] = command.position, command.velocity
            effort[:, view.actuators] = command.effort
            sim.set_control(position, velocity, effort)
            sim.apply_wrench(pull, hands)
            sim.step(world.physics.substeps)
            seen.see(sim.get_state())
            poses = np.concatenate([seen.frame_pose(None, tool) for tool in controller._servo._frames.names])
            between = P.compose(P.inverse(poses[0]), poses[1])
            apart.append(P.norm(between[:3] - wanted[:3]))
            joints = sim.get_state().joint_pos[0]
            lost += [abs(joints[i] - m.multiplier * joints[m.joint] - m.offset) for i, m in followers]
            off.append(P.norm(poses[:, :3] - P.compose(base, target)[:, :3]).max())
    print(
        f"{robot} {engine}: hands {1e3 * max(apart):.2f} mm apart, {1e3 * max(off):.2f} mm off their way, "
        f"followers off by {1e3 * max(lost):.3f} mm"
    )
    assert max(apart) <= 0.005
    assert max(lost) <= 1e-4
