"""The simple named surface of an engine, for scripts and agents: dictionaries by joint and tool name."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from anysim.conventions import Array
from anysim.errors import EngineError, listing, suggest
from anysim.math import pose as P

if TYPE_CHECKING:
    from anysim.engine.base import SimEngine


def observation(engine: "SimEngine", robot_name: str | None, skip_images: bool) -> dict[str, Array]:
    """See `SimEngine.get_observation`."""
    robot = engine.index.robot(robot_name)
    joints = list(engine.index.robot_joints(robot.name))
    state = engine.get_state()
    result: dict[str, Array] = {
        "joint_pos": state.joint_pos[:, joints],
        "joint_vel": state.joint_vel[:, joints],
        "base_pose": state.body_pose[:, engine.index.entity(robot.name).root].copy(),
    }
    for tool in robot.tools:
        frame = engine.index.frame(f"{robot.name}.{tool}")
        local = np.array([*frame.position, *frame.quaternion])
        result[f"{tool}_pose"] = P.compose(state.body_pose[:, frame.body], local[None])
    if not skip_images:
        for camera in engine.world.cameras:
            result[f"images/{camera.name}"] = engine.render(camera.name)["rgb"]
    return result


def send(engine: "SimEngine", action: Mapping[str, float] | Any, robot_name: str | None) -> None:
    """Write position targets; see `SimEngine.send_action`."""
    robot = engine.index.robot(robot_name)
    joints = engine.index.robot_joints(robot.name)
    drives = [i for i, a in enumerate(engine.world.actuators) if a.joint in joints]
    names = [engine.world.joints[engine.world.actuators[i].joint].name[len(robot.name) + 1 :] for i in drives]
    if not isinstance(action, Mapping):
        engine.set_control(position=action, actuators=drives)
        return
    unknown = [name for name in action if name not in names]
    if unknown:
        raise EngineError(
            f"robot '{robot.name}' has no driven joint '{unknown[0]}'{suggest(unknown[0], names)} "
            f"(joints: {listing(names)})"
        )
    chosen = [drives[names.index(name)] for name in action]
    values = np.array([np.broadcast_to(np.asarray(v, dtype=float), engine.num_envs) for v in action.values()]).T
    engine.set_control(position=values.reshape(engine.num_envs, len(chosen)), actuators=chosen)
