"""One YAML grips alike on every engine: a Panda holds a cube, at rest and shaken."""

import numpy as np
import pytest

from anysim.api import compile_world
from anysim.engine.factory import create_simulation
from anysim.math import pose as P
from anysim.testing.engines import require_engine
from anysim_schemas.run import RunSpec

SPEC = {
    "world": {
        "robots": {"panda": {"robot": "franka_panda"}},
        "objects": {"cube": {"source": {"box": [0.04, 0.04, 0.04]}, "mass": 0.2, "friction": 0.5}},
        "layout": {"cube": {"position": [0.5, 0.0, 0.25]}},
        "contact_sensors": {"cube": {"body": "cube"}},
    }
}
CREEP = 2e-4
"""[m/s] of a held cube of 2 N in a grip of 2 x 40 N: 0.04 mm/s on MuJoCo, 0.11 on PyBullet, none on SAPIEN."""
SLIP = 4e-3
"""[m] of shaking with up to 8 m/s^2: 2.7 mm after 6 s on MuJoCo and PyBullet, none on SAPIEN."""
WIDTH = 2e-4
"""[m] of a finger's place at a cube of 40 mm: 0.007 mm of sink on MuJoCo, 0.1 mm before the cube on PyBullet."""


@pytest.mark.parametrize("name", ["mujoco", "pybullet", "sapien"])
def test_a_grip_holds(name):
    require_engine(name)
    world = compile_world(RunSpec.model_validate(SPEC))
    robot = world.robots[0]
    gripper, tool = robot.channels["eef"], world.sites[robot.tools["tool"]]
    assert gripper.closed is not None
    targets = np.array([world.joints[a.joint].initial for a in world.actuators])
    targets[list(gripper.actuators)] = gripper.closed
    with create_simulation(name).create_world(world) as engine:
        cube = engine.index.body("cube")

        def hand():
            pose = engine.get_state().body_pose[0, tool.body]
            return P.compose(pose, P.pose(tool.position, tool.quaternion))

        def held():
            """The cube's place in the tool's frame (3,)."""
            return P.compose(P.inverse(hand()), engine.get_state().body_pose[0, cube])[:3]

        at = hand()
        engine.set_control(position=targets[None])
        for _ in range(150):  # until the fingers have closed
            engine.set_body_state(pose=at, twist=np.zeros(6), bodies=[cube])
            engine.step()
        engine.step(150)
        start = held()
        engine.step(500)
        assert np.linalg.norm(held() - start) < CREEP, "it creeps out of the grip"
        state = engine.get_state()
        assert state.contact_force[0, 0] == pytest.approx([0.0, 0.0, 0.2 * 9.81], abs=0.05)
        assert state.joint_pos[0, list(gripper.joints)] == pytest.approx(0.02, abs=WIDTH)
        start = held()
        for k in range(150):
            swing = targets.copy()
            swing[0] += 0.15 * np.sin(2 * np.pi * 1.5 * 0.02 * k)
            swing[3] += 0.08 * np.sin(2 * np.pi * 2.0 * 0.02 * k)
            engine.set_control(position=swing[None])
            engine.step(10)
            assert np.linalg.norm(held() - start) < SLIP, "it slips when it is shaken"


def test_the_panda_has_the_preset():
    """Pads of 4 ms, stiff and with priority; a heavy enough finger whose limits are as stiff."""
    world = compile_world(RunSpec.model_validate(SPEC))
    pads = [g.surface for g in world.geoms if g.collides and "finger" in g.name]
    assert pads
    assert all((s.softness, s.impedance, s.priority, s.torsional) == (0.004, (0.99, 0.999), 1, True) for s in pads)
    fingers = [world.joints[i] for i in world.robots[0].channels["eef"].joints]
    assert all(j.armature == 0.1 and j.limit_softness == 0.004 for j in fingers)
