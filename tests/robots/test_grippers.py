"""Every gripper of the catalogue takes a cube of 0.2 kg from a stand, lifts it and holds it, on every engine."""

from typing import NamedTuple

import numpy as np
import pytest

from anysim.api import compile_world
from anysim.assets.catalogue import load_robot, missing_source
from anysim.engine.base import SimEngine
from anysim.engine.factory import create_simulation
from anysim.kinematics.chain import Chain
from anysim.math import pose as P
from anysim.model.world import World
from anysim.planning.api import inverse_kinematics
from anysim.testing.engines import require_engine
from anysim.testing.tracking import bolted
from anysim_schemas.run import RunSpec
from tests.tiers import in_turn


class Task(NamedTuple):
    """A cube's edge, and how far it is lifted [m], by which hand, and from where."""

    edge: float
    lift: float
    tool: str = "tool"
    arm: str | None = None
    """The group of the arm's joints that carries the tool; all of them if not given."""
    fingers: str | None = None
    """The group of the hand's joints."""
    at: tuple[float, float, float] | None = None
    """Where the tool begins, pointing down and opened along y; its place at home if not given."""
    beside: float = 0.0
    """[m] from the tool to the cube along the tool's y: so far a fixed jaw passes beside it."""
    bolted: bool = False
    """Whether the trunk is held, of a robot whose legs would answer to what the arm does."""


TASKS = {
    "franka_panda": Task(0.04, 0.1),
    "ur5_gripper": Task(0.04, 0.1),
    "ur10_gripper": Task(0.05, 0.1),
    "xarm7_gripper": Task(0.04, 0.1),
    "z1": Task(0.026, 0.06),
    "so100": Task(0.02, 0.04),
    "so101": Task(0.02, 0.04),
    "mobile_panda": Task(0.04, 0.1),
    "mobile_ur5": Task(0.04, 0.1),
    "mobile_dual_panda left": Task(0.04, 0.1, "left_tool", "left", "left"),
    "mobile_dual_panda right": Task(0.04, 0.1, "right_tool", "right", "right"),
    "baxter left": Task(0.03, 0.1, "left", "left", "left"),
    "baxter right": Task(0.03, 0.1, "right", "right", "right"),
    "pr2 left": Task(0.04, 0.1, "left_tool", "left", "left", (0.6, 0.25, 0.7)),
    "pr2 right": Task(0.04, 0.1, "right_tool", "right", "right", (0.6, -0.25, 0.7)),
    "tiago_pro left": Task(0.04, 0.1, "left_tool", "left", "left", (0.55, 0.25, 0.75)),
    "tiago_pro right": Task(0.04, 0.1, "right_tool", "right", "right", (0.55, -0.25, 0.75)),
    "talos_full left": Task(0.05, 0.1, "left_hand", "left", "left", (0.35, 0.25, 1.0), bolted=True),
    "talos_full right": Task(0.05, 0.1, "right_hand", "right", "right", (0.35, -0.25, 1.0), bolted=True),
    "b1_z1": Task(0.026, 0.06, at=(0.6, 0.0, 0.5), beside=0.002, bolted=True),
    "koch": Task(0.02, 0.04),
    "aloha left": Task(0.04, 0.1, "left", "left", "left", (0.35, 0.0, 0.25)),
    "aloha right": Task(0.04, 0.1, "right", "right", "right", (0.588, 0.0, 0.25)),
}
DOWN = (1.0, 0.0, 0.0, 0.0)
"""The quaternion (x, y, z, w) of a tool that points down."""
HOLD = 3.0
SLIP = 0.01
"""[m] that the cube may move in the hand from the end of the grip to the end of the hold."""


@pytest.mark.parametrize(("hand", "engine"), in_turn(TASKS))
def test_a_gripper_lifts_a_cube(hand: str, engine: str) -> None:
    require_engine(engine)
    robot, task = hand.split()[0], TASKS[hand]
    absent = missing_source(load_robot(robot))
    if absent:
        pytest.skip(f"{robot}: {absent}")
    bare = _world(robot)
    arm = Arm(bare, task)
    above = arm.tool_pose(arm.begin)
    place = above[:3] - [0.0, 0.0, task.lift]
    cube = place + task.beside * P.to_matrix(above[3:])[:, 1]
    world = _world(robot, arm.home, _scene(task, cube, _heading(above)))
    assert [j.name for j in world.joints] == [j.name for j in bare.joints]
    with create_simulation(engine).create_world(bolted(world) if task.bolted else world) as sim:
        script = Script(sim, world, arm, task)
        script.wait(0.4)
        sag = above[:3] - script.tool()[:3]
        down = arm.path(above, place, sag, steps=25)
        script.follow(down, opened=True, seconds=0.6)
        script.wait(0.2)
        script.grip(1.2)
        start, held = script.cube()[2], script.in_hand()
        script.follow(down[::-1], opened=False, seconds=0.6)
        script.wait(HOLD)
        gain, slip = script.cube()[2] - start, np.linalg.norm(script.in_hand() - held)
    print(f"{hand} {engine}: gain {gain * 1000:.1f} mm of {task.lift * 1000:.0f}, slip {slip * 1000:.2f} mm")
    assert slip < SLIP, "it slips"
    assert abs(gain - task.lift) < 0.25 * task.lift, "it is not lifted as far as the hand goes"


def _world(robot: str, home: dict[str, float] | None = None, scene: dict | None = None) -> World:
    spec = {"world": {"robots": {"robot": {"robot": robot, "home": home or {}}}, **(scene or {})}}
    return compile_world(RunSpec.model_validate(spec))


def _members(world: World, channel: str, group: str | None) -> list[int]:
    """World indices of a channel's joints, or of one of its groups."""
    robot = world.robots[0]
    assert robot.entry is not None
    joints = robot.channels[channel].joints
    if group is None:
        return list(joints)
    names = {f"robot.{name}" for name in robot.entry.channels[channel].groups[group]}
    return [j for j in joints if world.joints[j].name in names]


def _heading(tool: np.ndarray) -> float:
    """The angle of the tool's y axis about the vertical: the cube's faces lie across the opening."""
    y = P.to_matrix(tool[3:])[:, 1]
    return float(np.arctan2(y[1], y[0]))


def _scene(task: Task, place: np.ndarray, yaw: float) -> dict:
    """The cube on a slender stand, so that fingers of any length pass beside it."""
    top = float(place[2]) - task.edge / 2
    x, y = float(place[0]), float(place[1])
    return {
        "objects": {
            "stand": {"source": {"cylinder": [0.3 * task.edge, top]}, "fixed": True},
            "cube": {"source": {"box": [task.edge] * 3}, "mass": 0.2, "friction": 0.8},
        },
        "layout": {"stand": {"position": [x, y, top / 2]}, "cube": {"position": [x, y, float(place[2])], "yaw": yaw}},
    }


class Arm:
    """A robot's kinematics: the joints of the channel `arm` that bring one of its tools somewhere.

    `begin` holds the positions (J,) of all joints of the world that it starts from, `home` those of the arm
    and the opened hand by name.
    """

    def __init__(self, world: World, task: Task) -> None:
        chain = Chain.from_world(world, "robot", "arm", task.tool, joints=_members(world, "arm", task.arm))
        root = world.bodies[chain.root]
        self.chain, self.ik = chain, inverse_kinematics(chain)
        self.base = np.array([[*root.position, *root.quaternion]])
        self.begin = np.array([j.initial for j in world.joints])
        eef = world.robots[0].channels["eef"]
        assert eef.opened is not None
        fingers = [world.joints[world.actuators[a].joint] for a in eef.actuators]
        self.home = {
            joint.name.removeprefix("robot."): opened
            for joint, opened in zip(fingers, eef.opened, strict=True)
            if joint.mimic is None
        }
        if task.at is not None:
            found = self.ik.solve(
                np.array([[*task.at, *DOWN]]),
                self.base,
                chain.initial[None],
                random_restarts=50,
                rng_seeds=np.array([1], dtype=np.uint64),
            )
            assert found.converged[0], "the tool cannot begin there"
            self.begin[chain.joints] = found.joint_pos[0]
            names = [name.removeprefix("robot.") for name in chain.joint_names]
            self.home |= dict(zip(names, found.joint_pos[0].tolist(), strict=True))

    def tool_pose(self, joint_pos: np.ndarray) -> np.ndarray:
        """World pose (7,) of the tool for positions (J,) of all joints."""
        return self.chain.tool_pose(self.base[0], joint_pos[self.chain.joints])

    def path(self, above: np.ndarray, place: np.ndarray, sag: np.ndarray, steps: int) -> list[np.ndarray]:
        """All joints' positions along the straight line down to a place, keeping the tool's direction.

        What the drives give way by under the arm's weight, `sag` (3,) [m], is added to the goals.
        """
        q, line = self.begin.copy(), []
        for k in range(steps + 1):
            goal = np.concatenate([above[:3] + (place - above[:3]) * k / steps + sag, above[3:]])
            q[self.chain.joints] = self._near(q[self.chain.joints], goal)
            line.append(q.copy())
        return line

    def _near(self, joint_pos: np.ndarray, goal: np.ndarray) -> np.ndarray:
        """Positions (K,) of the arm: the place exactly, the orientation as well as the joints allow."""
        for _ in range(100):
            step = self.ik.step(
                goal[None], self.base, joint_pos[None], max_step=1.0, damping=1e-4, rotation_weight=(0.05, 0.05, 0.05)
            )
            if np.abs(step.joint_pos[0] - joint_pos).max() < 1e-7:
                break
            joint_pos = step.joint_pos[0]
        assert step.position_error[0] < 1e-3, "the tool cannot get there"
        return joint_pos


class Script:
    """What the arm is told, one control step of 20 ms after another, and what comes of it."""

    def __init__(self, sim: SimEngine, world: World, arm: Arm, task: Task) -> None:
        self.sim, self.task = sim, task
        self.step = 0.02
        robot = world.robots[0]
        self.site, eef = world.sites[robot.tools[task.tool]], robot.channels["eef"]
        self.drives = [a.joint for a in world.actuators]
        fingers = _members(world, "eef", task.fingers)
        driven = [self.drives[a] in fingers for a in eef.actuators]
        self.hand = np.array(eef.actuators)[driven]
        self.opened, self.closed = np.array(eef.opened)[driven], np.array(eef.closed)[driven]
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

    def tool(self) -> np.ndarray:
        """World pose (7,) of the tool."""
        body = self.sim.get_state().body_pose[0, self.site.body]
        return P.compose(body, P.pose(self.site.position, self.site.quaternion))

    def in_hand(self) -> np.ndarray:
        """The cube's place in the tool's frame (3,)."""
        return P.compose(P.inverse(self.tool()), self.sim.get_state().body_pose[0, self.body])[:3]
