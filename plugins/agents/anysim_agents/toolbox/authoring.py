"""Authoring: worlds and layouts of an agent's own, with the same errors as those of a file."""

from dataclasses import asdict
from typing import Any

from anysim.errors import SpecError, SpecIssue, TaskError, listing
from anysim.placement.proposals import faults
from anysim_agents import worlds
from anysim_agents.agent_env import AgentEnv
from anysim_agents.answers import Answer
from anysim_agents.arguments import CheckWorld, CreateWorld, ProposeLayout
from anysim_agents.toolbox.sessions import begun
from anysim_agents.workspace import Workspace
from anysim_schemas.proposals import Proposal


async def check_world(workspace: Workspace, args: CheckWorld) -> Answer:
    """Check the text of a world of your own, without building it.

    It tells every fault with line and column, what looks doubtful, and whether the engine can run it.
    """
    return Answer(await workspace.apart(lambda: worlds.report(args.yaml, workspace.limits, args.all_engines)))


async def create_world(workspace: Workspace, args: CreateWorld) -> Answer:
    """Begin a session of a world of your own, given as the text of a YAML file.

    It has shapes, procedural assets and robots of the catalogue, and may extend an installed task (`extends:
    task:NAME`); it cannot name files.
    """
    found = await workspace.apart(lambda: worlds.report(args.yaml, workspace.limits, False))
    if not found["ok"]:
        raise TaskError("\n".join(found["faults"]))
    if refused := [words for words in found["engines"].values() if words != worlds.RUNS]:
        raise TaskError("\n".join(refused))
    loaded = await workspace.apart(lambda: worlds.read(args.yaml, workspace.limits))
    return await begun(workspace, await workspace.create_world(loaded, args.num_envs, args.seed))


async def propose_layout(workspace: Workspace, args: ProposeLayout) -> Answer:
    """Begin an episode in which things are where you propose.

    Without poses you are told what can be placed, how large it is and where there is room. Every pose is checked
    (names, regions, collisions) and moved no further than the world's bounds allow; where one cannot be kept
    nothing changes, and each reason is told.
    """
    return Answer(await workspace.do(workspace.entry(args.session), lambda agent: _proposed(agent, args), changes=True))


TOOLS = ((propose_layout, ProposeLayout, False), (check_world, CheckWorld, True), (create_world, CreateWorld, False))


def _proposed(agent: AgentEnv, args: ProposeLayout) -> dict[str, Any]:
    import numpy as np

    i = agent.number(args.env)
    if agent.desk is None:
        raise TaskError("this world says itself where proposals come from (world.layout_source), and takes no others")
    request = agent.desk.request
    if request is None:
        raise TaskError("nothing in this world is placed by a layout: there is nothing to propose for")
    if not args.poses:
        data = asdict(request)
        del data["seed"]
        return {"request": data}
    proposal = Proposal(poses=args.poses, reason=args.reason)
    if wrong := faults(proposal, [thing.name for thing in request.things]):
        raise SpecError([SpecIssue("", f"propose_layout.poses.{name}", words) for name, words in wrong.items()])
    agent.reset(np.array([i]), args.seed, {}, proposal)
    env = agent.env
    env.scene.look(np.array([i]))
    rows = {}
    for name, wanted in proposal.poses.items():
        pose = env.scene.frame(name).pose[0]
        origin = agent.origin(i)
        moved = float(np.linalg.norm(pose[:3] - origin - np.array(wanted.position)))
        rows[name] = {"position": pose[:3], "quaternion": pose[3:], "moved_by": moved}
    others = listing([thing.name for thing in request.things if thing.name not in rows])
    return {"env": i, "placed": rows, "by_the_layout": others, "episode_seed": str(agent.histories[i].episode_seed)}
