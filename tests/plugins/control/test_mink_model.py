"""The MuJoCo model that mink computes with is the robot of the World."""

import mujoco
import numpy as np
import pytest

from anysim.errors import NameLookupError
from anysim.kinematics.pinocchio_model import RobotModel
from anysim.math import pose as P
from anysim.testing.tracking import robot_world
from anysim_control.tools.mink_model import kinematic_model


@pytest.mark.parametrize("robot", ["franka_panda", "unitree_g1"])
def test_every_frame_is_where_pinocchio_has_it(robot: str) -> None:
    world = robot_world(robot, yaw=0.4)
    model, reference = kinematic_model(world, "robot"), RobotModel(world, "robot")
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    assert model.nq == len(reference.joints)
    lower, upper = np.maximum(reference.lower, -3.0), np.minimum(reference.upper, 3.0)
    for _ in range(5):
        q = rng.uniform(lower, upper)
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        np.testing.assert_allclose(
            data.subtree_com[1], reference.com(reference.q(q)), atol=1e-9
        ) if reference.floating else None
        for name in [model.body(i).name for i in range(1, model.nbody)] + [
            model.site(i).name for i in range(model.nsite)
        ]:
            local = "base" if name == "robot" else name.removeprefix("robot.")
            kind = data.site if name in [model.site(i).name for i in range(model.nsite)] else data.body
            place = kind(name).xpos
            pose = reference.frame_pose(reference.q(q), reference.frame(local))
            np.testing.assert_allclose(place, pose[:3], atol=1e-9)
            matrix = kind(name).xmat.reshape(3, 3)
            np.testing.assert_allclose(matrix, P.to_matrix(pose[3:]), atol=1e-9)


def test_an_unknown_robot_is_refused() -> None:
    with pytest.raises(NameLookupError, match="there is no robot 'robt'; did you mean 'robot'"):
        kinematic_model(robot_world("franka_panda"), "robt")
