"""Commands under way: control steps of the envs that have something to do, in short turns between other operations."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.commands import CommandSequence
from anysim_agents.agent_env import AgentEnv
from anysim_schemas.collect import CollectSpec, CommandSpec

TURN_S = 0.1
"""Seconds of control steps after which other operations of the session have their turn; results do not depend on it."""


@dataclass
class Run:
    """Commands that were given to some envs together.

    Attributes:
        words: what was asked for, for people.
        ids: the envs.
        first: how many commands each has had in its episode before.
        steps: control steps that each has made of it.
        ended: how it ended, by env; empty while it is under way.
        over: whether it has ended in all of them.
    """

    words: str
    ids: Array
    sequence: CommandSequence
    first: dict[int, int]
    steps: dict[int, int] = field(default_factory=dict)
    ended: dict[int, dict[str, Any]] = field(default_factory=dict)
    over: bool = False


def begin(agent: AgentEnv, commands: CollectSpec, ids: Array) -> Run:
    """Give commands to envs. Runs on the simulator's thread.

    Raises:
        SpecError: at `commands.0.object`, what is wrong with them; nothing has begun.
        TaskError: an episode there has ended.
    """
    env = agent.env
    over = {int(i): str(env.status[i]) for i in ids if not env.running[i]}
    if over:
        raise TaskError(
            f"the episodes of envs {over} have ended, and nothing can be done in them; call reset for new ones, or "
            f"reset_to with a snapshot of a moment before"
        )
    sequence = agent.live.bound(commands)
    agent.stop.clear()
    agent.live.give(ids, sequence)
    given = [command for command in commands.commands if isinstance(command, CommandSpec)]
    first = {i: len(agent.histories[i].commands) for i in ids.tolist()}
    for i in first:
        agent.histories[i].commands.extend((command.do, command.params) for command in given)
    return Run(", ".join(command.do for command in given), ids, sequence, first, dict.fromkeys(first, 0))


def go_on(agent: AgentEnv, run: Run) -> dict[str, Any]:
    """A turn of control steps; the progress after it. Runs on the simulator's thread."""
    began = time.perf_counter()
    while not run.over and time.perf_counter() - began < TURN_S:
        _step(agent, run)
    return progress(agent, run)


def _step(agent: AgentEnv, run: Run) -> None:
    env, live = agent.env, agent.live
    if agent.stop.is_set():
        live.drop(np.array([i for i in run.ids.tolist() if i not in run.ended]))
        _end(agent, run, "cancelled")
        return
    ids = np.array([i for i in run.ids.tolist() if i not in run.ended])
    action = live.action(ids)
    on = [i for i in ids.tolist() if live.under_way(i)]
    for i in set(ids.tolist()) - set(on):
        run.ended[i] = _report(agent, run, i, str(OUTCOMES[live.outcome[i]]))
    if on:
        env.step(action, agent.mask(np.array(on)))
    for i in on:
        run.steps[i] += 1
        agent.histories[i].add(env, i, action[i], _numbered(live.describe(i), run.first[i]))
        if not env.running[i]:
            run.ended[i] = _report(agent, run, i, f"episode {env.status[i]}")
            live.drop(np.array([i]))
    run.over = len(run.ended) == len(run.ids)


def _numbered(said: Mapping[str, Any], before: int) -> dict[str, Any]:
    """What a command says, with its number in the episode: `3 place: lower`."""
    number, _, rest = str(said.get("phase", "")).partition(" ")
    return {**said, "phase": f"{int(number) + before} {rest}"} if number.isdecimal() else dict(said)


def _end(agent: AgentEnv, run: Run, outcome: str) -> None:
    for i in run.ids.tolist():
        if i not in run.ended:
            run.ended[i] = _report(agent, run, i, outcome)
    run.over = True


def _report(agent: AgentEnv, run: Run, env: int, outcome: str) -> dict[str, Any]:
    """How commands ended in an env."""
    said = dict(run.sequence.describe(env))
    done = run.sequence.segments(env, False)
    steps, dt = run.steps[env], agent.env.engine.world.physics.control_dt
    report: dict[str, Any] = {"env": env, "outcome": outcome, "ok": outcome == str(Outcome.OK)}
    if outcome != str(Outcome.OK):
        report |= {"at": said.get("phase", ""), "attempts": said.get("attempt", 1)}
        report |= {"tried": said["ladder"]} if "ladder" in said else {}
        report["advice"] = ADVICE.get(outcome, "")
    report |= {"commands_done": len(done), "steps": steps, "seconds": steps * dt}
    return report | {"status": str(agent.env.status[env]), "success": agent.terms(env)}


ADVICE: Mapping[str, str] = {
    "no_ik": "the arm cannot reach that place in that orientation; choose another object, place or robot, or move the "
    "base first",
    "collision": "something is in the way; move it first, or give `planner: rrt`",
    "missed_contact": "the hand closed on nothing; look at the scene again, and give `offset` or another part to hold",
    "unstable_grasp": "it slipped out of the hand; hold it elsewhere, or with more `force`",
    "timeout": "it took too long; give more time or `steps`, or a lower demand on accuracy",
    "controller": "the robot did not follow what it was told; look whether it is held up by something",
    "adverse_state": "the scene is not as this command needs it; `observe` it, and prepare it by another command",
    "no_path": "the planner found no way; clear one, or come from elsewhere",
    "wrong_object": "another object was touched or held; move it out of the way first",
    "jammed": "it is stuck; release it and begin again from another side",
    "lost": "what was held or done is so no longer; `observe` the scene, and do it again",
    "unreachable_base": "the base cannot get there; clear a way, or choose another place",
    "cancelled": "the robot holds where it was; the next command goes on from there",
    "episode truncated": "the episode ran out of control steps; call reset, or create a session with a larger horizon",
    "episode success": "the task is solved, which ends its episode here; create a session with on_success: continue to "
    "go on after it",
    "episode failed": "a condition of failure holds; call reset, or reset_to with a snapshot of a moment before",
}
"""What to do about each outcome, in a sentence."""


def progress(agent: AgentEnv, run: Run) -> dict[str, Any]:
    """Where commands stand."""
    under_way = [i for i in run.ids.tolist() if i not in run.ended]
    at = {str(i): run.sequence.describe(i).get("phase", "") for i in under_way[:8]}
    steps = max(run.steps.values(), default=0)
    return {"commands": run.words, "steps": steps, "under_way": len(under_way), "ended": len(run.ended), "at": at}
