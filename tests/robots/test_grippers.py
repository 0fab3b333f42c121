"""Every gripper of the catalogue takes a cube of 0.2 kg from a stand, lifts it and holds it, on every engine."""

from typing import NamedTuple

import numpy as np
import pytest

from anysim import registry
from anysim.api import compile_world
from anysim.engine.base import SimEngine
from anysim.engine.factory import create_simulation
from anysim.kinematics.model import RobotModel
from anysim.math import pose as P
from anysim.qualify.stage import missing_source
from anysim.world.catalogue import load_robot
from anysim.world.model import World
from anysim_schemas.run import RunSpec


class Task(NamedTuple):
    """A cube's edge, and how far it is lifted [m]."""

    edge: float
    lift: float


TASKS = {
    "franka_panda": Task(0.04, 0.1),
    "ur5_gripper": Task(0.04, 0.1),
    "ur10_gripper": Task(0.05, 0.1),
    "xarm7_gripper": Task(0.04, 0.1),
    "z1": Task(0.026, 0.06),
    "so100": Task(0.02, 0.04),
    "so101": Task(0.02, 0.04),
    "koch": Task(0.02, 0.04),
}
HOLD = 3.0
SLIP = 0.01
"""[m] that the cube may move in the hand from the end of the grip to the end of the hold."""


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
@pytest.mark.parametrize("robot", TASKS)
def test_a_gripper_lifts_a_cube(robot: str, engine: str) -> None:
    if engine not in registry.names("engines") or not registry.load("engines", engine).availability().available:
        pytest.skip(f"{engine} is not installed")
    absent = missing_source(load_robot(robot))
    if absent:
        pytest.skip(f"{robot}: {absent}")
    task = TASKS[robot]
    bare = compile_world(RunSpec.model_validate({"world": {"robots": {"arm": {"robot": robot}}}}))
    arm = Arm(bare)
    above = arm.model.frame_pose(arm.model.q(arm.model.initial), arm.tool)
    place = above[:3] - [0.0, 0.0, task.lift]
    world = compile_world(RunSpec.model_validate(_scene(robot, task, place, _heading(above))))
    assert [j.name for j in world.joints] == [j.name for j in bare.joints]
    with create_simulation(engine).create_world(world) as sim:
        script = Script(sim, world, arm, task)
        down = arm.path(above, place, steps=25)
        script.follow(down, opened=True, seconds=0.6)
        script.wait(0.2)
        script.grip(0.8)
        start, held = script.cube()[2], script.in_hand()
        script.follow(down[::-1], opened=False, seconds=0.6)
        script.wait(HOLD)
        gain, slip = script.cube()[2] - start, np.linalg.norm(script.in_hand() - held)
    print(f"{robot} {engine}: gain {gain * 1000:.1f} mm of {task.lift * 1000:.0f}, slip {slip * 1000:.2f} mm")
    assert slip < SLIP, "it slips"
    assert abs(gain - task.lift) < 0.25 * task.lift, "it is not lifted as far as the hand goes"


def _heading(tool: np.ndarray) -> float:
    """The angle of the tool's y axis about the vertical: the cube's faces lie across the opening."""
    y = P.to_matrix(tool[3:])[:, 1]
    return float(np.arctan2(y[1], y[0]))


def _scene(robot: str, task: Task, place: np.ndarray, yaw: float) -> dict:
    """The cube on a slender stand, so that fingers of any length pass beside it."""
    top = float(place[2]) - task.edge / 2
    x, y = float(place[0]), float(place[1])
    return {
        "world": {
            "robots": {"arm": {"robot": robot}},
            "objects": {
                "stand": {"source": {"cylinder": [0.3 * task.edge, top]}, "fixed": True},
                "cube": {"source": {"box": [task.edge] * 3}, "mass": 0.2, "friction": 0.8},
            },
            "layout": {
                "stand": {"position": [x, y, top / 2]},
                "cube": {"position": [x, y, float(place[2])], "yaw": yaw},
            },
        }
    }


class Arm:
    """A robot's kinematics: joints of the channel `arm` that bring its tool somewhere."""

    def __init__(self, world: World) -> None:
        self.model = RobotModel(world, "arm")
        self.tool = self.model.frame("tool")
        self.joints = np.array(world.robots[0].channels["arm"].joints)

    def path(self, above: np.ndarray, place: np.ndarray, steps: int) -> list[np.ndarray]:
        """All joints' positions along the straight line from home to a place, keeping the tool's direction."""
        q, line = self.model.initial.copy(), []
        for k in range(steps + 1):
            goal = above[:3] + (place - above[:3]) * k / steps
            q = self._solve(q, goal, P.to_matrix(above[3:]))
            line.append(q.copy())
        return line

    def _solve(self, q: np.ndarray, goal: np.ndarray, axes: np.ndarray) -> np.ndarray:
        """Damped least squares: the place exactly, the orientation as well as the joints allow."""
        q = q.copy()
        for _ in range(100):
            pose = self.model.frame_pose(q, self.tool)
            turn = 0.5 * np.cross(P.to_matrix(pose[3:]).T, axes.T).sum(axis=0)
            error = np.concatenate([goal - pose[:3], 0.05 * turn])
            if np.abs(error).max() < 1e-7:
                break
            jacobian = self.model.frame_jacobian(q, self.tool)[:, self.joints] * ([[1.0]] * 3 + [[0.05]] * 3)
            step = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + 1e-8 * np.eye(6), error)
            q[self.joints] = np.clip(
                q[self.joints] + step, self.model.lower[self.joints], self.model.upper[self.joints]
            )
        assert np.abs(goal - pose[:3]).max() < 1e-3, "the tool cannot get there"
        return q


class Script:
    """What the arm is told, one control step of 20 ms after another, and what comes of it."""

    def __init__(self, sim: SimEngine, world: World, arm: Arm, task: Task) -> None:
        self.sim, self.task = sim, task
        self.step = 0.02
        robot = world.robots[0]
        self.site, eef = world.sites[robot.tools["tool"]], robot.channels["eef"]
        self.drives = [a.joint for a in world.actuators]
        self.hand = list(eef.actuators)
        self.opened, self.closed = np.array(eef.opened), np.array(eef.closed)
        self.body = sim.index.body("cube")
        self.targets = np.array([world.joints[j].initial for j in self.drives])

    def follow(self, line: list[np.ndarray], *, opened: bool, seconds: float) -> None:
        steps = round(seconds / self.step)
        for k in range(1, steps + 1):
            fingers = self.targets[self.hand].copy()
            self.targets = line[round(k * (len(line) - 1) / steps)][self.drives]
            self.targets[self.hand] = self.opened if opened else fingers
            self._go()

    def grip(self, seconds: float) -> None:
        self.targets[self.hand] = self.closed
        self.wait(seconds)

    def wait(self, seconds: float) -> None:
        for _ in range(round(seconds / self.step)):
            self._go()

    def _go(self) -> None:
        self.sim.set_control(position=self.targets[None])
        self.sim.step(10)

    def cube(self) -> np.ndarray:
        return self.sim.get_state().body_pose[0, self.body, :3].copy()

    def in_hand(self) -> np.ndarray:
        """The cube's place in the tool's frame (3,)."""
        pose = self.sim.get_state().body_pose[0]
        tool = P.compose(pose[self.site.body], P.pose(self.site.position, self.site.quaternion))
        return P.compose(P.inverse(tool), pose[self.body])[:3]
