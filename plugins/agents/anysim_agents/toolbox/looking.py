"""Looking: what is where, in numbers and in images."""

from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.engine.capability import Capability
from anysim.errors import CapabilityError, NameLookupError, TaskError, listing
from anysim.math import pose as P
from anysim_agents.agent_env import AgentEnv
from anysim_agents.answers import Answer, png
from anysim_agents.arguments import LookAt, OfEnv, Render
from anysim_agents.limits import AgentLimits
from anysim_agents.workspace import Workspace


async def observe(workspace: Workspace, args: OfEnv) -> Answer:
    """Observe an env: where everything is, and how the episode stands.

    It tells the places of things, parts, goals and the robots' tools (position [m], quaternion x, y, z, w, in the
    world's frame), and which conditions of success hold.
    """
    return Answer(await workspace.do(workspace.entry(args.session), lambda agent: _observed(agent, args.env)))


async def render(workspace: Workspace, args: Render) -> Answer:
    """Draw what a camera of the session sees now, as an image."""
    return await workspace.do(workspace.entry(args.session), lambda agent: _rendered(agent, args))


async def look_at(workspace: Workspace, args: LookAt) -> Answer:
    """Look at a thing or a point from where you like, as an image.

    No camera of the session is moved by it.
    """
    return await workspace.do(workspace.entry(args.session), lambda agent: _looked(agent, args))


TOOLS = ((observe, OfEnv, True), (render, Render, True), (look_at, LookAt, True))


def _observed(agent: AgentEnv, number: int) -> dict[str, Any]:
    env, i = agent.env, agent.number(number)
    scene, world, state = env.scene, env.engine.world, env.engine.get_state()
    scene.look(np.array([i]))
    robots = {robot.name: robot for robot in world.robots}
    presence = env.engine.presence
    things: dict[str, Any] = {}
    for k, entity in enumerate(world.entities):
        if entity.name in robots or not presence[i, k]:
            continue
        pose, twist = state.body_pose[i, entity.root], state.body_twist[i, entity.root]
        row = _place(pose)
        if (speed := float(np.linalg.norm(twist[:3]))) > 1e-3:
            row["speed"] = speed
        joints = world.joints[entity.joint_start : entity.joint_stop]
        if joints:
            values = state.joint_pos[i, entity.joint_start : entity.joint_stop]
            row["joints"] = {
                j.name: {"position": float(q), "range": [j.lower, j.upper]} for j, q in zip(joints, values, strict=True)
            }
        things[entity.name] = row
    for slot in world.slots:  # what can be several things is known by its own name
        for e in slot.entities:
            name = world.entities[e].name
            if name != slot.name and name in things:
                things[slot.name] = {"is": name, **things.pop(name)}
    dt, steps = world.physics.control_dt, int(env.info["elapsed_steps"][i])
    task = env.spec.task
    return {
        "env": i,
        "instruction": env.instruction(i),
        "status": str(env.status[i]),
        "time_s": steps * dt,
        "left_s": (0 if task is None else task.horizon - steps) * dt,
        "success": agent.terms(i),
        "things": things,
        "robots": {name: _robot(agent, i, name) for name in robots},
        "goals": {name: rows[i] for name, rows in scene.goals.items()},
        "doing": agent.live.describe(i) if agent.live.under_way(i) else None,
    }


def _robot(agent: AgentEnv, i: int, name: str) -> dict[str, Any]:
    robot = agent.env.scene.robot(name)
    state = agent.env.engine.get_state()
    tools = {f"{name}.{tool}": _place(robot.tool(tool).pose[0]) for tool in robot.model.tools}
    joints = {channel: state.joint_pos[i, list(spec.joints)] for channel, spec in robot.model.channels.items()}
    return {"base": _place(robot.base.pose[0]), "tools": tools, "joints": joints}


def _place(pose: Array) -> dict[str, Any]:
    return {"position": pose[:3], "quaternion": pose[3:]}


# ---------------------------------------------------------------------------------------------------------- images


def _camera(agent: AgentEnv, name: str | None) -> str:
    """A camera of the world by name, else its first one.

    Raises:
        CapabilityError: the engine draws nothing.
        NameLookupError: there is no such camera.
    """
    engine = agent.env.engine
    if Capability.RENDER_RGB not in engine.capabilities:
        raise CapabilityError(
            f"the engine {engine.name} draws nothing; `observe` tells where things are, or create a session on "
            f"another engine (list_catalog kind: engines)"
        )
    names = [camera.name for camera in engine.world.cameras]
    if name is not None and name not in [*names, "default"]:
        raise NameLookupError(f"camera: there is no '{name[:60]}' (cameras: {listing([*names, 'default'])})")
    return name or (names[0] if names else "default")


def _size(limits: AgentLimits, width: int, height: int) -> None:
    if width * height > limits.pixels:
        raise TaskError(
            f"an image has at most {limits.pixels} pixels, asked for {width}x{height}; ask for a smaller one"
        )


def _rendered(agent: AgentEnv, args: Render) -> Answer:
    i, name = agent.number(args.env), _camera(agent, args.camera)
    known = {camera.name: (camera.width, camera.height) for camera in agent.env.engine.world.cameras}
    wide, high = known.get(name, (640, 480))
    width, height = args.width or wide, args.height or high
    _size(agent.limits, width, height)
    image = agent.env.render(name, [i], size=(width, height), markers=args.markers)[0]
    return Answer({"env": i, "camera": name, "size": [width, height]}, (png(image),))


def _looked(agent: AgentEnv, args: LookAt) -> Answer:
    i, name = agent.number(args.env), _camera(agent, None)
    engine, ids = agent.env.engine, [i]
    if name == "default":
        raise CapabilityError("this world has no camera that could look; `render` draws an overview of it")
    _size(agent.limits, args.width, args.height)
    target = _target(agent, i, args.target)
    around, up = np.radians(args.azimuth), np.radians(args.elevation)
    ray = np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
    eye = target + args.distance * ray
    pose = np.concatenate([eye, P.look_at(eye, target)])
    body = engine.world.cameras[engine.index.camera(name)].body
    if body >= 0:  # it rides on something
        pose = P.compose(P.inverse(engine.get_state().body_pose[i, body]), pose)
    before, fov = engine.camera_mounts(name, ids).copy(), engine.camera_fov(name, ids).copy()
    try:
        engine.set_camera_pose(name, pose[None], ids)
        engine.set_camera_fov(name, np.array([50.0]), ids)
        image = engine.render(name, args.width, args.height, env_ids=ids)["rgb"][0]
    finally:
        engine.set_camera_pose(name, before, ids)
        engine.set_camera_fov(name, fov, ids)
    return Answer({"env": i, "target": target, "eye": eye, "size": [args.width, args.height]}, (png(image),))


def _target(agent: AgentEnv, i: int, target: Any) -> Array:
    if not isinstance(target, str):
        return np.array(target, dtype=float)
    agent.env.scene.look(np.array([i]))
    frame = agent.env.scene.frame(target)
    if not frame.present[0]:
        raise TaskError(f"target: '{target}' is not there in env {i}; `observe` tells what is")
    return frame.position[0].copy()
