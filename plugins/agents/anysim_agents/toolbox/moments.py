"""Moments: keep one, go back to one, and see what would have been otherwise."""

from typing import Any

import numpy as np

from anysim.errors import TaskError
from anysim_agents.agent_env import AgentEnv
from anysim_agents.answers import Answer
from anysim_agents.arguments import Counterfactual, Reset, ResetTo, Snapshot
from anysim_agents.history import History
from anysim_agents.workspace import Workspace

APART = 1e-6
"""[m] from which on two places are told apart, as of `anysim counterfactual`."""
MOST_TOLD = 12


async def snapshot(workspace: Workspace, args: Snapshot) -> Answer:
    """Keep this moment, to go back to it with `reset_to`.

    Going on from it is the same to the bit, and what a hand holds it goes on to hold.
    """
    entry = workspace.entry(args.session)
    taken = await workspace.do(entry, lambda agent: _taken(agent, args), changes=True)
    return Answer(taken)


def _taken(agent: AgentEnv, args: Snapshot) -> dict[str, Any]:
    name = agent.take(agent.numbers(args.envs))
    return {"snapshot": name, "envs": list(agent.snapshots[name].histories), "kept": list(agent.snapshots)}


async def reset(workspace: Workspace, args: Reset) -> Answer:
    """Begin new episodes, drawn anew or from a seed; `changes` are values in place of what would be drawn."""

    def job(agent: AgentEnv) -> dict[str, Any]:
        ids = agent.numbers(args.envs)
        agent.reset(ids, args.seed, args.changes)
        env = agent.env
        rows = [{"env": i, "episode_seed": str(agent.histories[i].episode_seed)} for i in ids.tolist()]
        return {"reset": rows, "instruction": env.instruction(int(ids[0]))}

    return Answer(await workspace.do(workspace.entry(args.session), job, changes=True))


async def reset_to(workspace: Workspace, args: ResetTo) -> Answer:
    """Go back to a moment that was kept; `changes` are values to go on with in place of those of then."""

    def job(agent: AgentEnv) -> dict[str, Any]:
        kept = agent.taken(args.snapshot)
        agent.put(kept, args.changes)
        env = agent.env
        return {"envs": [{"env": i, "status": str(env.status[i]), "steps": len(h)} for i, h in kept.histories.items()]}

    return Answer(await workspace.do(workspace.entry(args.session), job, changes=True))


async def counterfactual(workspace: Workspace, args: Counterfactual) -> Answer:
    """See what would have been, had something been otherwise.

    What was done since a moment is done again, once as it was and once with `changes`, such as
    {objects.cube.mass: 0.5}. It tells from which control step on things differ, and where they end. The session
    is afterwards as it was.
    """
    if not args.changes:
        raise TaskError(
            "counterfactual.changes: give at least one value by its path; `status` lists them as can_change"
        )
    entry = workspace.entry(args.session)
    return Answer(await workspace.do(entry, lambda agent: _otherwise(agent, args), changes=True))


TOOLS = (
    (snapshot, Snapshot, False),
    (reset, Reset, False),
    (reset_to, ResetTo, False),
    (counterfactual, Counterfactual, True),
)


def _otherwise(agent: AgentEnv, args: Counterfactual) -> dict[str, Any]:
    i = agent.number(args.env)
    history = agent.histories[i]
    start = 0
    if args.snapshot is not None:
        before = agent.taken(args.snapshot).histories.get(i)
        if before is None:
            raise TaskError(
                f"snapshot: '{args.snapshot}' has no env {i}; it has {list(agent.taken(args.snapshot).histories)}"
            )
        start = len(before)
        if before.episode_seed != history.episode_seed or not _same(before, history):
            raise TaskError(f"snapshot: '{args.snapshot}' is of another course of events than env {i} has now")
    actions = history.actions[start:]
    if not actions:
        raise TaskError("nothing has been done since then; give a command first, or an earlier snapshot")
    if len(actions) > agent.limits.replay:
        raise TaskError(
            f"there are {len(actions)} control steps since then, and at most {agent.limits.replay} are repeated; take "
            f"a later snapshot"
        )
    ids = np.array([i])
    now = agent.keep(ids)
    try:
        as_was = _course(agent, args, i, actions, {})
        changed = _course(agent, args, i, actions, args.changes)
    finally:
        agent.put(now, {})
    return _compared(agent, as_was, changed, start)


def _same(before: History, now: History) -> bool:
    """Whether an episode has gone on from an earlier moment of it."""
    return len(before) <= len(now) and all(
        np.array_equal(a, b) for a, b in zip(before.actions, now.actions, strict=False)
    )


def _course(
    agent: AgentEnv, args: Counterfactual, i: int, actions: list[Any], changes: dict[str, Any]
) -> dict[str, Any]:
    """The course of events with changes: places of bodies after each step, how it stood, and what held at its end."""
    env, mask = agent.env, agent.mask(np.array([i]))
    if args.snapshot is None:
        history = agent.histories[i]
        for manager in env.managers:
            manager.recall(i, history.drawn)
        own = dict(history.overridden) | changes
        env.reset(mask=mask, episode_seeds=[history.episode_seed], overrides=own)
    else:
        kept = agent.taken(args.snapshot)
        row = list(kept.histories).index(i)
        env.reset_to(kept.snapshot.rows([row]), [i], changes or None)
    poses = [env.engine.get_state().body_pose[i].copy()]
    whole = np.zeros((env.num_envs, env.action_dim))
    for action in actions:
        if not env.running[i]:
            break
        whole[i] = action
        env.step(whole, mask)
        poses.append(env.engine.get_state().body_pose[i].copy())
    return {"poses": np.array(poses), "status": str(env.status[i]), "success": agent.terms(i)}


def _compared(agent: AgentEnv, was: dict[str, Any], changed: dict[str, Any], start: int) -> dict[str, Any]:
    world = agent.env.engine.world
    steps = min(len(was["poses"]), len(changed["poses"]))
    apart = np.linalg.norm(was["poses"][:steps, :, :3] - changed["poses"][:steps, :, :3], axis=2)
    first = np.flatnonzero((apart > APART).any(axis=1))
    rows = []
    for entity in world.entities:
        a, b = was["poses"][-1][entity.root, :3], changed["poses"][-1][entity.root, :3]
        if (distance := float(np.linalg.norm(a - b))) > APART:
            rows.append({"thing": entity.name, "as_it_was": a, "changed": b, "distance": distance})
    rows.sort(key=lambda row: -row["distance"])
    return {
        "steps": len(was["poses"]) - 1,
        "diverges_at_step": None if len(first) == 0 else start + int(first[0]),
        "as_it_was": {"status": was["status"], "success": was["success"]},
        "changed": {"status": changed["status"], "success": changed["success"]},
        "things": rows[:MOST_TOLD],
    }
