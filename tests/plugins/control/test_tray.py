"""Two hands carry a tray with a cup: `pink_ik` solves both arms as one problem, and the hands keep their distance.

The robot's trunk is fixed. Baxter grips the tray's handles, the G1 has it lie on its hands; the two UR5 have no hands,
so a tray's weight pulls at their flanges. Tested is how far the hands come from the places at the tray's ends, as seen
from each other, while they move up, forward, and to the side and back; and that tray and cup come along. What other
channels move (a head) is held at home, and fingers that follow others have to follow throughout.
"""

from pathlib import Path
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
from anysim.model.world import World
from anysim.testing.tracking import bolted, robot_world

ENGINES = ("mujoco", "pybullet", "sapien")
WEIGHT = 3.0
"""[N] of a tray of 0.3 kg, where it is a load alone: their drives give way by what it takes."""
CARRYING = 2.5
"""[s] of which it moves for the first 1.5."""
APART = 0.005
"""[m] that the hands may come from their places as seen from each other."""


class Tray(NamedTuple):
    """A tray between two hands; the place is that of its plate, relative to the middle between the tools."""

    size: tuple[float, float, float]
    """[m] of the plate."""
    handles: float
    """[m] height of the upright handles at both ends along y; 0 for none."""
    below: float
    """[m] of the plate below the tools."""
    home: dict[str, float] | None = None
    closing: float = 0.0
    """[s] for which somebody holds the tray until the hands have closed."""


TRAYS = {
    "baxter": Tray((0.3, 0.82, 0.01), 0.09, 0.08, closing=0.8),
    "unitree_g1": Tray(
        (0.25, 0.5, 0.01), 0.0, -0.065,
        {"left_elbow_joint": -0.2, "right_elbow_joint": -0.2},
    ),
    "dual_ur5": None,
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("robot", TRAYS)
def test_two_hands_carry_a_tray(robot: str, engine: str, tmp_path: Path) -> None:
    tray = TRAYS[robot]
    world = bolted(_world(robot, tray, tmp_path))
    with create_simulation(engine) as sim:
        sim.create_world(world, 1)
        sim.reset()
        hands = Hands(sim, world)
        apart, off, lost = [], [], [0.0]
        followers = [(i, j.mimic) for i, j in enumerate(world.joints) if j.mimic is not None]
        wanted = P.compose(P.inverse(hands.start[0]), hands.start[1])
        if tray is not None:
            hands.take(tray.closing)
            begun = hands.cargo()
        for step in range(round(CARRYING / 0.02)):
            target = hands.start.copy()
            target[:, :3] += _way(step * 0.02 / 1.5)
            hands.go(target, pull=0.0 if tray else 0.5 * WEIGHT)
            poses = hands.poses()
            between = P.compose(P.inverse(poses[0]), poses[1])
            apart.append(P.norm(between[:3] - wanted[:3]))
            joints = sim.get_state().joint_pos[0]
            lost += [abs(joints[i] - m.multiplier * joints[m.joint] - m.offset) for i, m in followers]
            off.append(P.norm(poses[:, :3] - P.compose(hands.base, target)[:, :3]).max())
        moved = np.linalg.norm(hands.cargo() - begun, axis=1) if tray is not None else np.zeros(2)
    print(
        f"{robot} {engine}: hands {1e3 * max(apart):.2f} mm apart, {1e3 * max(off):.2f} mm off their way, "
        f"followers off by {1e3 * max(lost):.3f} mm; tray and cup moved {1e3 * moved[0]:.1f}, {1e3 * moved[1]:.1f} mm"
    )
    assert max(apart) <= APART
    assert max(lost) <= 1e-4
    assert (moved < 0.005).all()


def _way(share: float) -> Array:
    """(3,) [m] from the start: up and forward by 8 cm and 10 cm, and to the side and back."""
    share = min(share, 1.0)
    smooth = 3 * share**2 - 2 * share**3
    return np.array([0.10 * smooth, 0.06 * np.sin(2 * np.pi * smooth), 0.08 * smooth])


def _world(robot: str, tray: Tray | None, folder: Path) -> World:
    """The robot half a metre above the ground and, at its hands, the tray with a cup on it."""
    if tray is None:
        return robot_world(robot, position=[0.0, 0.0, 0.5])
    bare = robot_world(robot, position=[0.0, 0.0, 0.5], home=tray.home or {})
    bodies = bare.initial_body_pose
    sites = [bare.sites[site] for site in bare.robots[0].tools.values()]
    tools = [P.compose(bodies[site.body], P.pose(site.position, site.quaternion)) for site in sites]
    x, y, z = (float(number) for number in np.mean(tools, axis=0)[:3])
    z -= tray.below
    file = folder / "tray.urdf"
    file.write_text(_urdf(tray), encoding="utf-8")
    return robot_world(
        robot,
        position=[0.0, 0.0, 0.5],
        home=tray.home or {},
        objects={
            "objects": {
                "tray": {"source": {"asset": str(file)}, "friction": 0.8},
                "cup": {"source": {"cylinder": [0.03, 0.06]}, "mass": 0.1, "friction": 0.8},
            },
            "layout": {"tray": {"position": [x, y, z]}, "cup": {"position": [x, y, z + 0.5 * tray.size[2] + 0.03]}},
        },
    )


def _urdf(tray: Tray) -> str:
    """A plate of 0.2 kg, with upright handles of 2 cm at its ends if it has any."""
    x, y, z = tray.size
    boxes = [((x, y, z), (0.0, 0.0, 0.0))]
    if tray.handles:
        boxes += [((0.1, 0.02, tray.handles), (0.0, side * 0.42, 0.5 * tray.handles)) for side in (1, -1)]
    solids = "".join(
        f'<collision><origin xyz="{p[0]} {p[1]} {p[2]}"/><geometry><box size="{s[0]} {s[1]} {s[2]}"/></geometry>'
        "</collision>"
        for s, p in boxes
    )
    return (
        '<robot name="tray"><link name="tray"><inertial><mass value="0.2"/>'
        '<inertia ixx="0.01" iyy="0.003" izz="0.012" ixy="0" ixz="0" iyz="0"/></inertial>'
        f"{solids}</link></robot>"
    )


class Hands:
    """Both arms under `pink_ik`, and the fingers, if any, opened or closed."""

    def __init__(self, sim: SimEngine, world: World) -> None:
        self.sim, self.world = sim, world
        self.seen = ControlledRobot(world, "robot")
        self.seen.see(sim.get_state())
        self.view = ChannelView.of(world, world.robots[0].channels["arm"], self.seen)
        made: Any = registry.load("controllers", "pink_ik")
        self.controller = made(self.view, 1, velocity_scale=0.5)
        self.position = np.array([[world.joints[a.joint].initial for a in world.actuators]])
        self.controller.reset(np.array([0]), self.position[:, self.view.actuators])
        self.tools = list(world.robots[0].tools)
        self.bodies = [world.sites[site].body for site in world.robots[0].tools.values()]
        self.base = self.seen.base_pose(None)
        self.start = P.compose(P.inverse(self.base), self.poses())
        roots = {entity.name: entity.root for entity in world.entities}
        self.things = [roots[name] for name in ("tray", "cup") if name in roots]

    def take(self, seconds: float) -> None:
        """Close the hands on what somebody holds; then it is theirs."""
        eef = self.world.robots[0].channels.get("eef")
        if eef is not None:
            self.position[:, list(eef.actuators)] = eef.closed
        held = self.sim.get_state().body_pose[:, self.things].copy()
        for _ in range(round(seconds / 0.02)):
            self.sim.set_body_state(held, np.zeros((1, len(self.things), 6)), None, self.things)
            self.go(self.start, pull=0.0)
        for _ in range(25):
            self.go(self.start, pull=0.0)

    def go(self, target: Array, pull: float) -> None:
        """One control step of 20 ms to tool poses (2, 7) in the base's frame; `pull` [N] downwards at each hand."""
        self.seen.see(self.sim.get_state())
        command = self.controller.apply(target.reshape(1, -1), None)
        velocity, effort = np.zeros_like(self.position), np.zeros_like(self.position)
        self.position[:, self.view.actuators], velocity[:, self.view.actuators] = command.position, command.velocity
        effort[:, self.view.actuators] = command.effort
        self.sim.set_control(self.position, velocity, effort)
        if pull:
            wrench = np.zeros((1, 2, 6))
            wrench[:, :, 2] = -pull
            self.sim.apply_wrench(wrench, self.bodies)
        self.sim.step(self.world.physics.substeps)
        self.seen.see(self.sim.get_state())

    def poses(self) -> Array:
        """World poses (2, 7) of the tools."""
        return np.concatenate([self.seen.frame_pose(None, tool) for tool in self.tools])

    def cargo(self) -> Array:
        """Places (2, 3) of tray and cup in the first tool's frame."""
        tool = self.poses()[0]
        return np.array([P.compose(P.inverse(tool), self.sim.get_state().body_pose[0, i])[:3] for i in self.things])
