"""Hands at the ends of arms close on cylinders and hold them, by the closing commands of their entries."""

from typing import Any, NamedTuple

import numpy as np
import pytest

from anysim import registry
from anysim.controllers.base import ChannelView
from anysim.controllers.robot import ControlledRobot
from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.factory import create_simulation
from anysim.math import pose as P
from anysim.testing.tracking import bolted, robot_world
from tests.tiers import by_turns

CONTROL_DT = 0.02
PHYSICS = {"control_dt": CONTROL_DT, "impratio": 10.0}
"""MuJoCo's friction creeps by what presses sideways over the mass of what it presses on; ten times less like this.

Without it TIAGo's four fingers move 0.3 kg past the thumb by 2 mm a second.
"""
SETTLING, FALLING, CLOSING, HOLDING = 0.2, 0.16, 0.8, 3.0
"""[s] for the arm to find its place, with a cylinder in the open hand, in the closing hand, and in the closed hand."""

TOGETHER = ("gripper_binary", {}, (1.0,), (-1.0,))
"""Controller, its parameters, and the actions that open and close."""


def synergies(*names: str) -> tuple[str, dict[str, Any], tuple[float, ...], tuple[float, ...]]:
    params = {"mode": "synergies", "synergies": list(names), "speed": 3.0}
    return "gripper_multi_finger", params, (0.0,) * len(names), (1.0,) * len(names)


class Grip(NamedTuple):
    """A cylinder for each hand of a robot whose root is fixed."""

    places: dict[str, tuple[float, float, float]]
    """Its middle [m] in the frame of each palm."""
    diameter: float
    length: float
    mass: float
    command: tuple[str, dict[str, Any], tuple[float, ...], tuple[float, ...]]
    roll: float = 0.0
    """[rad] of its axis from the palm's z."""
    posture: dict[str, float] | None = None
    """[rad] of arms that would not leave room for it at home."""


def both(joints: dict[str, float]) -> dict[str, float]:
    """Of arms that mirror each other."""
    return {name.replace("SIDE", side): value for side in ("left", "right") for name, value in joints.items()}


HEY5 = (0.15, 0.05, 0.0)
"""On the knuckles, between the fingers and the thumb."""
GRIPS = {
    "xarm7_allegro": Grip(
        {"hand_palm_link": (0.0415, 0.0, -0.014)}, 0.06, 0.22, 0.3, synergies("power"), roll=np.pi / 2
    ),
    "unitree_g1_hands": Grip(
        {"left_hand_palm_link": (0.057, -0.045, 0.0), "right_hand_palm_link": (0.057, 0.045, 0.0)}, 0.05, 0.16, 0.3,
        synergies("left_power", "right_power"),
        # forearms forward, or the cylinders are in the thighs
        posture=both({"SIDE_shoulder_pitch_joint": 0.0, "SIDE_elbow_joint": 0.0}),
    ),
    "tiago": Grip(
        {"hand_palm_link": HEY5}, 0.06, 0.11, 0.3, TOGETHER,
        posture={
            "arm_1_joint": 1.5, "arm_2_joint": 0.0, "arm_3_joint": 0.0, "arm_4_joint": 1.0, "arm_5_joint": 0.0,
            "arm_6_joint": 0.0,
        },
    ),
    "tiago_dual": Grip(
        {"hand_left_palm_link": HEY5, "hand_right_palm_link": HEY5}, 0.06, 0.11, 0.3, TOGETHER,
        posture=both({
            "arm_SIDE_1_joint": 0.86, "arm_SIDE_2_joint": -0.36, "arm_SIDE_3_joint": 2.07, "arm_SIDE_4_joint": 1.57,
            "arm_SIDE_5_joint": -0.14, "arm_SIDE_6_joint": -0.72, "arm_SIDE_7_joint": -0.55,
        }),
    ),
}  # fmt: skip


class Hands:
    """A robot with its hands, and the cylinders in them."""

    def __init__(self, sim: SimEngine, grip: Grip) -> None:
        self.sim, self.grip, self.world = sim, grip, sim.world
        self.robot = ControlledRobot(self.world, "robot")
        self.view = ChannelView.of(self.world, self.world.robots[0].channels["eef"], self.robot)
        name, params, self.opened, self.closed = grip.command
        made: Any = registry.load("controllers", name)
        self.controller = made(self.view, 1, **params)
        self.targets = np.array([[self.world.joints[a.joint].initial for a in self.world.actuators]])
        self.bodies = [sim.index.body(f"cylinder{i}") for i in range(len(grip.places))]
        self.robot.see(sim.get_state())
        self.controller.reset(np.array([0]), self.targets[:, self.view.actuators])

    def command(self, action: tuple[float, ...]) -> None:
        self.robot.see(self.sim.get_state())
        self.targets[:, self.view.actuators] = self.controller.apply(np.array([action]), None).position
        self.sim.set_control(position=self.targets)

    def go(self, action: tuple[float, ...], seconds: float, held: Array | None = None) -> list[Array]:
        """The cylinders in the palms (H, 7) after each control step; `held` (H, 7) in the world if given.

        Somebody holds what is held: it is put back so often that no finger moves it by more than a fraction of a
        millimetre.
        """
        seen, substeps = [], self.world.physics.substeps
        for _ in range(round(seconds / CONTROL_DT)):
            self.command(action)
            for _ in range(1 if held is None else 5):
                self.sim.step(substeps if held is None else substeps // 5)
                if held is not None:
                    self.put(held)
            seen.append(P.compose(P.inverse(self.palms()), self.sim.get_state().body_pose[0, self.bodies]))
        return seen

    def put(self, poses: Array) -> None:
        self.sim.set_body_state(poses[None], np.zeros((1, len(poses), 6)), None, self.bodies)

    def palms(self) -> Array:
        self.robot.see(self.sim.get_state())
        return np.concatenate([self.robot.frame_pose(None, link) for link in self.grip.places])

    def places(self) -> Array:
        """Where the cylinders belong (H, 7), for the palms as they are now."""
        turn = P.from_roll_pitch_yaw(np.array([self.grip.roll, 0.0, 0.0]))
        return P.compose(self.palms(), np.array([P.pose(place, turn) for place in self.grip.places.values()]))


def scene(grip: Grip) -> dict[str, Any]:
    """Cylinders that lie aside at first."""
    thing = {"source": {"cylinder": [grip.diameter / 2, grip.length]}, "mass": grip.mass, "friction": 0.8}
    names = [f"cylinder{i}" for i in range(len(grip.places))]
    return {
        "objects": dict.fromkeys(names, thing),
        "layout": {name: {"position": [2.0, float(i), grip.length / 2]} for i, name in enumerate(names)},
    }


@pytest.mark.parametrize(("robot", "engine"), by_turns(GRIPS))
def test_the_hands_of_a_robot_hold_cylinders_for_three_seconds(robot: str, engine: str) -> None:
    """What is allowed is a sixth of the diameter in the palm's frame. Open hands let go of all, in the same places."""
    grip = GRIPS[robot]
    scenery, posture = scene(grip), grip.posture or {}
    world = bolted(robot_world(robot, physics=PHYSICS, objects=scenery, position=[0.0, 0.0, 0.5], home=posture))
    with create_simulation(engine).create_world(world, 1) as sim:
        hands = Hands(sim, grip)
        hands.go(hands.opened, SETTLING)
        places = hands.places()
        hands.put(places)
        hands.go(hands.opened, FALLING)
        fallen = places[:, 2] - sim.get_state().body_pose[0, hands.bodies, 2]
        assert (fallen > grip.diameter).all(), "it does not take a grip to hold it there"
        hands.go(hands.closed, CLOSING, held=hands.places())
        start = P.compose(P.inverse(hands.palms()), sim.get_state().body_pose[0, hands.bodies])
        moved = np.array([P.norm(now[:, :3] - start[:, :3]) for now in hands.go(hands.closed, HOLDING)])
        print(f"{robot} {engine}: moved {np.round(1e3 * moved.max(axis=0), 2)} mm in the hand")
        assert (moved.max(axis=0) < grip.diameter / 6).all(), f"they moved {1e3 * moved.max(axis=0)} mm"
        fingers = hands.robot.joints[hands.view.joint_columns]
        joints = sim.get_state().joint_pos[0, fingers]
        assert (joints > hands.view.lower - 0.02).all()
        assert (joints < hands.view.upper + 0.02).all()
