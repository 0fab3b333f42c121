"""Tools on engines: arms of the catalogue follow a circle, and two hands carry a tray."""

import numpy as np
import pytest

from anysim.math import pose as P
from anysim.testing.tracking import Circle, follow

CIRCLE = Circle(radius=0.05, speed=0.2)
"""10 cm across: at 0.2 m/s the tool is accelerated by 0.8 m/s^2."""
ARMS = ("franka_panda", "ur5", "ur10", "xarm7", "kinova_j2")
ENGINES = ("mujoco", "pybullet", "sapien")
TURN = 0.002
"""[rad] root mean square, of the tool's orientation."""
OTHERS = {"differential_ik": (0.0005, TURN), "batched_ik": (0.0005, TURN), "operational_space": (0.001, 0.003)}
"""Root mean square distance [m] and turn [rad]. `operational_space` gives way to what it does not know."""


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("robot", ARMS)
def test_quadratic_programs_keep_tools_on_a_circle(robot: str, engine: str) -> None:
    for controller in ("pink_ik", "mink_ik"):
        seen = follow(robot, controller, engine, CIRCLE, seconds=1.5)
        print(f"{robot} {controller} {engine}: rms {1e3 * seen.rms:.3f} mm, worst {1e3 * seen.worst:.3f} mm")
        assert seen.rms <= (0.002 if engine == "mujoco" else 0.004), (controller, seen)
        assert seen.turn <= TURN, (controller, seen)


@pytest.mark.slow
@pytest.mark.parametrize("controller", OTHERS)
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("robot", ["franka_panda", "xarm7"])
def test_the_other_terms_follow_too(robot: str, controller: str, engine: str) -> None:
    """The xarm7 has dry friction of 1 N m at each joint, and a last link of 0.0001 kg m^2 on an armature of 0.05."""
    seen = follow(robot, controller, engine, CIRCLE, seconds=1.5)
    print(f"{robot} {controller} {engine}: rms {1e3 * seen.rms:.3f} mm, turn {1e3 * seen.turn:.3f} mrad")
    distance, turn = OTHERS[controller]
    assert seen.rms <= distance, seen
    assert seen.turn <= turn, seen


@pytest.mark.parametrize("time", [0.0, 0.3, 0.5, 1.7])
def test_the_circle_has_its_radius_and_its_speed(time: float) -> None:
    start = np.array([0.4, 0.1, 0.5, 0.0, 0.0, 0.0, 1.0])
    here, there = CIRCLE.pose(start, time), CIRCLE.pose(start, time + 1e-5)
    centre = start[:3] - [0.0, 0.0, CIRCLE.radius]
    assert abs(P.norm(here[:3] - centre) - CIRCLE.radius) < 1e-12
    speed = P.norm(there[:3] - here[:3]) / 1e-5
    share = min(time / CIRCLE.rise, 1.0)
    assert abs(speed - CIRCLE.speed * (3 * share**2 - 2 * share**3)) < 1e-4
