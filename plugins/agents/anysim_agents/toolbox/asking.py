"""Asking: facts in words, and questions whose answers were found twice."""

from dataclasses import replace
from itertools import accumulate
from typing import Any

import numpy as np

from anysim.errors import TaskError, listing
from anysim.record.header import EpisodeHeader
from anysim_agents.agent_env import AgentEnv
from anysim_agents.answers import Answer
from anysim_agents.arguments import Ask
from anysim_agents.workspace import Workspace


async def ask(workspace: Workspace, args: Ask) -> Answer:
    """Ask about an env in words: the scene, the task, the story so far, or questions with verified answers.

    Questions are about this moment: what lies on what, what is left of what, what is within reach, what came
    first, ... No model answers: every word follows from the state of the simulation.
    """
    return Answer(await workspace.do(workspace.entry(args.session), lambda agent: _asked(agent, args)))


TOOLS = ((ask, Ask, True),)


def _asked(agent: AgentEnv, args: Ask) -> dict[str, Any]:
    from anysim_language.episode import Deed, going
    from anysim_language.instruction import instruction_text
    from anysim_language.narration import narration
    from anysim_language.scene_text import scene_text

    i = agent.number(args.env)
    history = agent.histories[i]
    blind, loaded = agent.blind()
    header = EpisodeHeader(
        env=i,
        episode=0,
        episode_seed=history.episode_seed,
        drawn=dict(history.drawn),
        overridden=dict(history.overridden),
        instruction=agent.env.instruction(i),
    )
    doings = list(accumulate(history.doings, lambda last, now: now or last))  # the last one, where time only passes
    poses, joints = np.array(history.poses), np.array(history.joints)
    episode = going(blind, loaded, header, poses, joints, doings, str(agent.env.status[i]))
    episode = replace(episode, deeds=tuple(Deed(skill, params) for skill, params in history.commands))
    if args.about == "scene":
        return {"scene": scene_text(episode, step=-1)}
    if args.about == "task":
        return {"task": instruction_text(episode)}
    if args.about == "story":
        return {"story": [{"step": s.step, "text": s.text} for s in narration(episode)]}
    return _questions(episode, args)


def _questions(episode: Any, args: Ask) -> dict[str, Any]:
    from anysim_language.questions.all import chosen, verified

    things = sorted(thing.name for thing in episode.things)
    if args.thing is not None and args.thing not in things:
        raise TaskError(f"ask.thing: there is no '{args.thing[:60]}' (things: {listing(things, 40)})")
    last = len(episode.body_pose) - 1
    found = [one.question for one in verified(episode, [last]) if one.agreed]
    families = sorted({question.family for question in found})
    if args.family is not None and args.family not in families:
        raise TaskError(
            f"ask.family: nothing of '{args.family[:60]}' can be asked now (what can: {listing(families, 40)})"
        )
    wanted = [
        question
        for question in found
        if args.family in (None, question.family)
        and (args.thing is None or args.thing in question.refers.values() or args.thing in question.program.values())
    ]
    rows = [
        {"family": q.family, "question": q.text, "answer": q.answer, "names": dict(q.refers)}
        for q in chosen(wanted, args.most)
    ]
    return {"found": len(wanted), "families": families, "questions": rows}
