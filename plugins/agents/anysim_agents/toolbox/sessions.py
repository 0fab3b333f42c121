"""Sessions: begin one, see how it stands, end it."""

from typing import Any

from anysim.engine.capability import Capability
from anysim.errors import TaskError
from anysim_agents.agent_env import AgentEnv
from anysim_agents.answers import Answer
from anysim_agents.arguments import CreateSession, OfSession, OptionalSession
from anysim_agents.workspace import Entry, Workspace
from anysim_serving.catalogue import SessionRequest


async def create_session(workspace: Workspace, args: CreateSession) -> Answer:
    """Begin a session of a task: a simulator of your own, with its episodes begun.

    Nothing moves until you give a command or wait. It answers with the word for the session, what there is, and
    which cameras and parts it has.
    """
    overrides: list[str] = []
    if args.horizon is not None:
        if args.horizon > workspace.limits.horizon:
            raise TaskError(f"create_session.horizon: at most {workspace.limits.horizon} control steps")
        overrides.append(f"task.horizon={args.horizon}")
    if args.on_success is not None:
        overrides.append(f"task.on_success={args.on_success}")
    chosen = args.model_dump(exclude={"horizon", "on_success"})
    request = SessionRequest(**chosen, overrides=tuple(overrides))
    return await begun(workspace, await workspace.create(request))


async def begun(workspace: Workspace, entry: Entry) -> Answer:
    """What an agent is told of a session that has begun."""
    return Answer({"session": entry.handle, **await workspace.do(entry, about)})


def about(agent: AgentEnv) -> dict[str, Any]:
    """What a session has."""
    env, world = agent.env, agent.env.engine.world
    task = env.spec.task
    assert task is not None
    joints = {e.name: [j.name for j in world.joints[e.joint_start : e.joint_stop]] for e in world.entities}
    robots = {robot.name for robot in world.robots}
    return {
        "task": env.name,
        "instruction": env.instruction(0),
        "engine": env.engine.name,
        "num_envs": env.num_envs,
        "control_dt_s": world.physics.control_dt,
        "horizon": task.horizon,
        "on_success": task.on_success,
        "robots": {
            robot.name: {"channels": list(robot.channels), "tools": [f"{robot.name}.{tool}" for tool in robot.tools]}
            for robot in world.robots
        },
        "things": [slot.name for slot in world.slots] or [e.name for e in world.entities if e.name not in robots],
        "parts": {name: found for name, found in joints.items() if found and name not in robots},
        "goals": list(env.scene.goals),
        "cameras": [camera.name for camera in world.cameras],
        "can_draw": Capability.RENDER_RGB in env.engine.capabilities,
        "success": list(agent.terms(0)),
    }


async def status(workspace: Workspace, args: OptionalSession) -> Answer:
    """Tell how a session stands, or without one all sessions and the limits of this server.

    Of a session: the commands under way, or how the last ones ended; each env's episode; snapshots; and what
    `changes` may name.
    """
    if args.session is None:
        sessions = [workspace.about(entry) for entry in workspace.visible()]
        return Answer({"sessions": sessions, "limits": vars(workspace.sessions.limits) | vars(workspace.limits)})
    entry = workspace.entry(args.session)
    return Answer(workspace.about(entry) | await workspace.do(entry, _standing))


def _standing(agent: AgentEnv) -> dict[str, Any]:
    env = agent.env
    dt = env.engine.world.physics.control_dt
    rows = [
        {
            "env": i,
            "status": str(env.status[i]),
            "steps": int(env.info["elapsed_steps"][i]),
            "seconds": int(env.info["elapsed_steps"][i]) * dt,
            "success": agent.terms(i),
        }
        for i in range(env.num_envs)
    ]
    return {"envs": rows, "snapshots": list(agent.snapshots), "can_change": list(env.counterfactuals.paths)}


async def end_session(workspace: Workspace, args: OfSession) -> Answer:
    """End a session, and free its simulator; commands under way are given up."""
    entry = workspace.entry(args.session)
    await workspace.end(entry)
    return Answer({"ended": args.session})


TOOLS = ((create_session, CreateSession, False), (status, OptionalSession, True), (end_session, OfSession, False))
