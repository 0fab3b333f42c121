"""Articulated objects on every engine: what drawers, doors, lids and valves do, against answers worked out by hand."""

import numpy as np
import pytest

from anysim.engine.base import SimEngine
from anysim.engine.capability import Capability
from anysim.engine.factory import create_simulation, runnable
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import JointType, World
from anysim.testing.audit import audit
from tests.parity.articulated import (
    CABINET,
    DT,
    about_axis,
    by_hand,
    compiled,
    falling,
    lifted,
    pushed,
    random_positions,
    trolley,
    under_the_hand,
)

ENGINES = runnable(Capability.DYNAMICS)

pytestmark = pytest.mark.parametrize("name", ENGINES)

FORCES = {JointType.PRISMATIC: 12.0, JointType.REVOLUTE: 1.5}
"""[N] and [N m] that open every drawer and door of the cabinet."""


def started(name: str, world: World, num_envs: int = 1) -> SimEngine:
    engine = create_simulation(name).create_world(world, num_envs)
    engine.reset()
    return engine


def push(engine: SimEngine, joints: dict[str, float], steps: int) -> None:
    """Push or turn joints whose axes keep their direction, by these forces [N] and torques [N m], for so many steps."""
    wrench = np.zeros((engine.num_envs, len(joints), 6))
    bodies = []
    for column, (name, force) in enumerate(joints.items()):
        joint = engine.world.joints[engine.index.joint(name)]
        turn = engine.get_state().body_pose[0, joint.body, 3:]
        axis = P.rotate(turn[None], np.array(joint.axis)[None])[0]
        first = 0 if joint.type is JointType.PRISMATIC else 3
        wrench[:, column, first : first + 3] = force * axis
        bodies.append(joint.body)
    engine.apply_wrench(wrench, bodies)
    engine.step(steps)


def test_an_audit_of_a_cabinet_a_box_and_a_valve_is_clean(name: str) -> None:
    """Masses, centres, inertias, limits, friction, damping, volumes, axes, order and frames."""
    world = compiled(
        {
            "cabinet": CABINET,
            "box": {"source": "procedural:hinge_box"},
            "tap": {"source": {"procedural": "valve", "params": {"limits": [0.0, 6.0]}}, "fixed": True},
        },
        box={"position": [0, 0, 0.71]},
        tap={"position": [1.0, 0, 0]},
    )
    with started(name, world) as engine:
        lines = audit(engine)
    assert len(lines) > 100
    assert [line for line in lines if line.ok is False] == []
    assert {"friction", "damping", "limits", "principal moments"} <= {line.quantity for line in lines if line.ok}


def test_handles_are_where_the_neutral_kinematics_has_them(name: str) -> None:
    """Within 1e-6 m of it, and so within 2e-6 m of each other, at random openings."""
    world = compiled({"cabinet": CABINET})
    positions = random_positions(world, np.random.default_rng(4), 3)
    with started(name, world, 3) as engine:
        engine.set_joint_state(positions, np.zeros_like(positions))
        found = engine.get_state().body_pose
        handles = [engine.index.frame(site.name) for site in world.sites if site.name.endswith(".handle")]
    wanted = forward_kinematics(world, np.repeat(world.initial_body_pose[None], 3, axis=0), positions)
    assert len(handles) == 7
    for frame in handles:
        local = np.tile([*frame.position, *frame.quaternion], (3, 1))
        error = P.compose(found[:, frame.body], local) - P.compose(wanted[:, frame.body], local)
        assert np.abs(error[:, :3]).max() <= 1e-6, frame.name


def test_nothing_touches_in_a_closed_cabinet_and_nothing_moves(name: str) -> None:
    with started(name, compiled({"cabinet": CABINET})) as engine:
        engine.step(250)
        assert len(engine.contacts().env) == 0
        assert np.abs(engine.get_state().joint_pos).max() <= 1e-6


def test_a_drawer_moves_as_its_mass_friction_and_damping_say(name: str) -> None:
    """x(t) of m a = F - f - c v; a step's way is what the time step leaves open. Below the friction nothing moves."""
    world = compiled({"cabinet": CABINET})
    with started(name, world) as engine:
        joint = world.joints[engine.index.joint("cabinet.drawer_1")]
        steps = 150
        x, v = pushed(6.0, world.bodies[joint.body].inertial.mass, joint, steps * DT)
        push(engine, {"cabinet.drawer_1": 6.0}, steps)
        state = engine.get_state()
        assert abs(state.joint_pos[0, 0] - x) <= v * DT
        assert abs(state.joint_vel[0, 0] - v) <= 2e-3 * v
        assert 0.05 < x < joint.upper
        engine.reset()
        push(engine, {"cabinet.drawer_1": 0.9 * joint.friction}, 1000)
        assert abs(engine.get_state().joint_pos[0, 0]) <= 1e-5


def test_a_door_stays_where_it_is_left(name: str) -> None:
    """Also in a cabinet that leans by 1.7 degrees; without friction it would not."""
    positions = {}
    for friction in (0.2, 0.0):
        joints = {"door_*": {"friction": friction, "initial": 0.7}}
        leaning = {"position": [0.0, 0.0, 0.0], "roll": 0.03}
        world = compiled({"cabinet": {**CABINET, "joints": joints}}, cabinet=leaning)
        with started(name, world) as engine:
            engine.step(1000)
            doors = [engine.index.joint(f"cabinet.door_{i}") for i in (1, 2, 3)]
            positions[friction] = engine.get_state().joint_pos[0, doors]
    assert np.abs(positions[0.2] - 0.7).max() <= 1e-5
    assert np.abs(positions[0.0] - 0.7).min() > 0.1


def test_a_lid_falls_as_a_pendulum_with_friction(name: str) -> None:
    """Within what one time step leaves open, and then lies still on its limit without touching the box."""
    box = {"source": "procedural:hinge_box", "fixed": True, "joints": {"lid": {"initial": 1.0}}}
    world = compiled({"box": box})
    joint = world.joints[0]
    angle, rate = falling(world.bodies[joint.body].inertial, joint, 1.0, 0.2)
    with started(name, world) as engine:
        engine.step(100)
        state = engine.get_state()
        assert abs(state.joint_pos[0, 0] - angle) <= abs(rate) * DT
        assert abs(state.joint_vel[0, 0] - rate) <= 3e-3 * abs(rate)
        assert angle < 0.6
        engine.step(1500)
        assert abs(engine.get_state().joint_pos[0, 0]) <= 1e-4
        assert abs(engine.get_state().joint_vel[0, 0]) <= 1e-5
        assert len(engine.contacts().env) == 0


@pytest.mark.parametrize("limits", [None, [0.0, 1.2]])
def test_a_valve_turns_as_its_inertia_friction_and_damping_say(name: str, limits: list[float] | None) -> None:
    """Without end, or up to its limit."""
    source = {"procedural": "valve", "params": {"limits": limits} if limits else {}}
    world = compiled({"tap": {"source": source, "fixed": True}})
    joint = world.joints[0]
    angle, rate = pushed(0.3, about_axis(world.bodies[joint.body].inertial, joint), joint, 150 * DT)
    with started(name, world) as engine:
        push(engine, {"tap.wheel": 0.3}, 150)
        state = engine.get_state()
        if limits is None:
            assert abs(state.joint_pos[0, 0] - angle) <= rate * DT
            assert abs(state.joint_vel[0, 0] - rate) <= 2e-3 * rate
        else:
            push(engine, {"tap.wheel": 0.3}, 500)
            assert abs(engine.get_state().joint_pos[0, 0] - limits[1]) <= 1e-3


def test_limits_hold_what_pulls_at_an_open_drawer(name: str) -> None:
    """Within 0.1 mm at 50 N, and shut at 50 N the other way."""
    world = compiled({"cabinet": CABINET})
    with started(name, world) as engine:
        for force, limit in ((50.0, world.joints[0].upper), (-50.0, 0.0)):
            push(engine, {"cabinet.drawer_1": force}, 1500)
            assert abs(engine.get_state().joint_pos[0, 0] - limit) <= 1e-4
            assert abs(engine.get_state().joint_vel[0, 0]) <= 1e-4


def test_all_drawers_of_a_column_open_and_shut_together(name: str) -> None:
    """And a door beside them, which is hinged on the far side."""
    world = compiled({"cabinet": {"source": "procedural:cabinet", "fixed": True}})
    with started(name, world) as engine:
        forces = {joint.name: FORCES[joint.type] for joint in world.joints}
        assert len(forces) == 4
        push(engine, forces, 1500)
        upper = np.array([joint.upper for joint in world.joints])
        assert np.abs(engine.get_state().joint_pos[0] - upper).max() <= 1e-3
        push(engine, {joint: -force for joint, force in forces.items()}, 2000)
        assert np.abs(engine.get_state().joint_pos[0]).max() <= 1e-3
        assert len(engine.contacts().env) == 0


def test_a_thing_in_a_drawer_comes_out_with_it(name: str) -> None:
    """The drawer's floor and walls are solid: a block in it follows, and does not fall through."""
    block = {"source": {"box": [0.05, 0.05, 0.05]}, "mass": 0.2}
    drawers = {**CABINET, "joints": {"drawer_1": {"opened": 0.5}}}
    inside = compiled({"cabinet": drawers})
    frame = next(site for site in inside.sites if site.name == "cabinet.drawer_1.inside")
    floor = P.compose(inside.initial_body_pose[frame.body], np.array([*frame.position, *frame.quaternion]))
    at = [*floor[:2].tolist(), float(floor[2]) + 0.026]
    world = compiled({"cabinet": drawers, "block": block}, block={"position": at})
    with started(name, world) as engine:
        engine.step(100)
        before = engine.get_state().body_pose[0, engine.index.body("block")].copy()
        push(engine, {"cabinet.drawer_1": 10.0}, 125)
        state = engine.get_state()
        moved = state.body_pose[0, engine.index.body("block")] - before
        travel = state.joint_pos[0, 0] - 0.5 * world.joints[0].upper
        assert travel > 0.06
        assert np.abs(moved[:3] - [travel, 0, 0]).max() <= 1e-3, "3 m/s^2 are less than friction can give"
        push(engine, {"cabinet.drawer_1": 10.0}, 500)
        block = engine.get_state().body_pose[0, engine.index.body("block")]
        assert abs(block[2] - before[2]) <= 1e-3, "the stop at the end throws it against the front, not out"


@pytest.mark.parametrize("friction", [2.0, 10.0])
def test_a_hand_opens_a_drawer_by_its_handle(name: str, friction: float) -> None:
    """A Panda grips the bar and rises by 6 cm; the bar stays in the hand, and the drawer comes along."""
    world = by_hand(friction=friction)
    robot = world.robots[0]
    arm, gripper, tool = robot.channels["arm"], robot.channels["eef"], world.sites[robot.tools["tool"]]
    assert gripper.closed is not None
    local = P.pose(tool.position, tool.quaternion)
    targets = np.array([world.joints[a.joint].initial for a in world.actuators])
    with started(name, world) as engine:
        drawer = engine.index.joint("tray.drawer_1")
        handle = engine.index.frame("tray.drawer_1.handle")

        def place(body: int, offset: np.ndarray) -> np.ndarray:
            return P.compose(engine.get_state().body_pose[0, body], offset)

        def held() -> np.ndarray:
            """The handle's place in the hand (3,)."""
            bar = place(handle.body, P.pose(handle.position, handle.quaternion))
            return P.compose(P.inverse(place(tool.body, local)), bar)[:3]

        root = engine.index.body("tray")
        engine.set_body_state(pose=under_the_hand(world, place(tool.body, local))[None, None], bodies=[root])
        assert np.abs(held()).max() <= 1e-5
        targets[list(gripper.actuators)] = gripper.closed
        engine.set_control(position=targets[None])
        engine.step(250)
        start, height = held(), place(tool.body, local)[2]
        for _ in range(60):
            poses = engine.get_state().body_pose[0]
            change = lifted(world, poses, tool.body, place(tool.body, local)[:3], list(arm.joints), 1e-3)
            targets[list(arm.actuators)] += change
            engine.set_control(position=targets[None])
            engine.step(10)
        engine.step(250)
        rise = place(tool.body, local)[2] - height
        assert 0.05 < rise < 0.07
        assert abs(engine.get_state().joint_pos[0, drawer] - rise) <= 1.5e-3
        assert np.abs(held() - start).max() <= 1.5e-3


def test_a_box_that_is_not_fixed_stands_and_its_lid_stays_shut(name: str) -> None:
    world = compiled({"box": {"source": "procedural:hinge_box"}}, box={"on": "terrain"})
    with started(name, world) as engine:
        engine.step(500)
        state = engine.get_state()
        assert np.abs(state.body_pose[0, 0, :3]).max() <= 1e-3
        assert abs(state.joint_pos[0, 0]) <= 1e-4


@pytest.mark.parametrize("kind", ["urdf", "mjcf"])
def test_a_floating_file_falls_with_its_joints_passive(name: str, kind: str, tmp_path) -> None:
    """Its centre of mass falls as g says; a flap with enough friction keeps its angle, a dial spins down on its own."""
    joints = {"hinge": {"initial": 0.4}, "slide": {"opened": 0.5}, "spin": {"damping": 0.0}}
    world = trolley(tmp_path, kind, joints=joints)
    with started(name, world) as engine:
        slide, hinge, spin = (engine.index.joint(f"trolley.{joint}") for joint in ("slide", "hinge", "spin"))
        assert np.allclose(engine.get_state().joint_pos[0, [slide, hinge]], [-0.08, 0.4], atol=1e-7)
        assert engine.index.frame("trolley.mark").body == engine.index.body("trolley.tray")
        engine.set_joint_state(velocity=[[3.0]], joints=[spin])
        start = _centre(engine)
        engine.step(100)
        state = engine.get_state()
        assert np.allclose(_centre(engine) - start, [0, 0, -0.5 * 9.81 * 0.04], atol=0.2 * 9.81 * DT)
        assert np.allclose(state.joint_pos[0, [slide, hinge]], [-0.08, 0.4], atol=1e-4)
        # nothing brakes the dial; the rest takes up no spin of it, so it turns on against the rest as before
        assert abs(state.joint_vel[0, spin] - 3.0) <= 1e-3


@pytest.mark.parametrize("kind", ["urdf", "mjcf"])
def test_a_fixed_file_has_the_friction_and_damping_that_the_world_says(name: str, kind: str, tmp_path) -> None:
    """What the file says, unless the world says otherwise; also the limits."""
    changed = {"slide": {"friction": 2.0, "damping": 3.0, "limits": [-0.3, 0.0]}}
    world = trolley(tmp_path, kind, fixed=True, joints=changed)
    with started(name, world) as engine:
        joint = world.joints[engine.index.joint("trolley.slide")]
        assert (joint.friction, joint.damping, joint.lower) == (2.0, 3.0, -0.3)
        x, v = pushed(5.0, world.bodies[joint.body].inertial.mass, joint, 150 * DT)
        push(engine, {"trolley.slide": -5.0}, 150)
        state = engine.get_state()
        assert abs(state.joint_pos[0, engine.index.joint("trolley.slide")] + x) <= v * DT
        hinge = world.joints[engine.index.joint("trolley.hinge")]
        assert (hinge.friction, hinge.damping) == (0.6, 0.05)


def _centre(engine: SimEngine) -> np.ndarray:
    """The centre of mass (3,) of all that moves in env 0."""
    poses = engine.get_state().body_pose[0]
    masses = np.array([body.inertial.mass for body in engine.world.bodies])
    places = P.compose(poses, np.array([[*body.inertial.com, 0, 0, 0, 1.0] for body in engine.world.bodies]))[:, :3]
    return (masses[:, None] * places).sum(axis=0) / masses.sum()
