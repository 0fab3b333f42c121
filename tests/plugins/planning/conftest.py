"""One arm before a table, a wall that it has to go around, and a cube; for tests of planners."""

import numpy as np
import pytest

from anysim import compile_world
from anysim.math import pose as P
from anysim.model.world import World
from anysim.planning.motion import PlanRequest, Scene, Scenes, ToolGoal

ROOM = """
world:
  terrain: plane
  robots:
    panda: {robot: franka_panda, position: [0, 0, 0], actions: {arm: default}}
  objects:
    wall: {source: {box: [0.5, 0.04, 0.7]}, fixed: true}
    cube: {source: {box: [0.04, 0.04, 0.04]}}
  layout:
    wall: {position: [0.5, 0.0, 0.35]}
    cube: {position: [0.5, 0.3, 0.021]}
"""


@pytest.fixture(scope="package")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    path = tmp_path_factory.mktemp("planning") / "room.yaml"
    path.write_text(ROOM)
    return compile_world(path)


@pytest.fixture
def scene(world: World) -> Scene:
    return Scenes(world, 1).scene(0)


def arm_joints(world: World) -> tuple[str, ...]:
    return tuple(joint.name for joint in world.joints[:7])


def down(*positions: tuple[float, float, float]) -> np.ndarray:
    """Poses (n, 7) of a tool that points down."""
    return np.array([[*position, 1.0, 0.0, 0.0, 0.0] for position in positions])


LEFT = np.array([0.8, 0.4, 0.0, -2.0, 0.0, 2.4, 0.785])
RIGHT = np.array([-0.8, 0.4, 0.0, -2.0, 0.0, 2.4, 0.785])


def across(world: World, **more: object) -> PlanRequest:
    """From one side of the wall to the other."""
    return PlanRequest(arm_joints(world), LEFT, joint_goal=RIGHT, **more)


def reach(world: World, poses: np.ndarray, **more: object) -> PlanRequest:
    return PlanRequest(arm_joints(world), LEFT, (ToolGoal("panda", "tool", poses),), **more)


def in_the_wall(world: World, scene: Scene, joint_pos: np.ndarray) -> bool:
    """Whether a corner of the robot's shapes is inside of the wall, by nothing that planners use."""
    from anysim.model.forward_kinematics import forward_kinematics

    wall = scene.body_pose[[b.name for b in world.bodies].index("wall")]
    positions = np.tile([joint.initial for joint in world.joints], (len(joint_pos), 1))
    positions[:, :7] = joint_pos
    bodies = forward_kinematics(world, np.tile(scene.body_pose, (len(joint_pos), 1, 1)), positions)
    meshes = {mesh.name: mesh.vertices for mesh in world.meshes}
    for geom in world.geoms:
        name = getattr(geom.shape, "mesh", None)
        if geom.collides and name and world.bodies[geom.body].name.startswith("panda"):
            vertices = P.compose(P.pose(geom.position, geom.quaternion), as_poses(meshes[name]))[:, :3]
            points = P.rotate(bodies[:, geom.body, None, 3:], vertices[None]) + bodies[:, geom.body, None, :3]
            local = P.rotate_inverse(np.broadcast_to(wall[3:], (*points.shape[:2], 4)), points - wall[:3])
            if (np.abs(local) < [0.25, 0.02, 0.35]).all(axis=-1).any():
                return True
    return False


def as_poses(points: np.ndarray) -> np.ndarray:
    return np.concatenate([points, np.tile([0.0, 0.0, 0.0, 1.0], (len(points), 1))], axis=1)
