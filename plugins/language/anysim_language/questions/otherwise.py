"""Counterfactual questions: what would happen to a thing if something were done now, from forks of the episode."""

from collections.abc import Iterator

import numpy as np

from anysim.model.parts import BodyKind
from anysim_language.changes import SHUT
from anysim_language.choice import choose
from anysim_language.moment import Moment, millimetres
from anysim_language.questions.forks import Fork
from anysim_language.questions.question import Asker, Question
from anysim_language.sentences import render
from anysim_language.things import Thing

FALLEN, STAYED = 30, 8
"""What falls or moves does so by at least the first [mm], what stays by at most the second; else nothing is asked."""
LEFT_OPEN = 0.02
"""A part stays as it is where it moves by at most this share of its range."""


def about_forks(asker: Asker) -> Iterator[Question]:
    """For one moment, each change and each loose thing or open part that has a clear outcome.

    None where things or robots do not stay by themselves: then what happens does not follow from the change. Of things
    that would stay, as most do, one is asked about for each change.
    """
    still, *forks = asker.past.forks.get(asker.step, ()) or (None,)
    if still is None or any(_outcome(asker, still, thing) != "stays" for thing in asker.moment.things if thing.robot):
        return
    calm = [t for t in asker.objects if _loose(asker, t) and _outcome(asker, still, t) == "stays"]
    for fork in forks:
        kind, what, part = fork.change[:3]
        if part and (outcome := _part_outcome(asker, fork)) and _part_outcome(asker, fork, still) == "stays":
            entity = asker.episode.world.entities[asker.moment.by_name[what].entity]
            yield _question(asker, fork, f"{what}{part.removeprefix(entity.name)}", outcome)
        outcomes = {t.name: _outcome(asker, fork, t) for t in calm if (kind, t.name) != ("remove", what)}
        moved = [name for name, outcome in outcomes.items() if outcome in ("falls", "moves")]
        stayed = [name for name, outcome in outcomes.items() if outcome == "stays"]
        for name in (*moved, *stayed[:1]):
            yield _question(asker, fork, name, outcomes[name])


def _question(asker: Asker, fork: Fork, about: str, outcome: str) -> Question:
    change, words, the = fork.change, asker.episode.vocabulary.words, asker.naming.the
    program = {**change._asdict(), "wrench": list(change.wrench), "thing": about, "outcome": outcome}
    key = (asker.episode.name, "change", asker.step, change.kind, change.what, change.part)
    viewer = [asker.moment.viewer.name] if change.kind == "push" and asker.moment.viewer.name else []
    entity = asker.episode.world.entities[asker.moment.by_name[change.what].entity]
    what = f"{change.what}{change.part.removeprefix(entity.name)}"
    values = {
        "force": f"{float(np.linalg.norm(change.wrench)):.3g}" if change.wrench else "",
        "seconds": f"{change.seconds:g}",
        "viewer": the(viewer[0]) if viewer else "",
    }
    template = choose(words.changes[change.kind], asker.seed, *key)
    done, of_it = (
        render(template, {**values, "what": said}) for said in (the(what), "it" if what == about else the(what))
    )
    refers = tuple(dict.fromkeys([about.partition(".")[0], change.what, *viewer]))
    return asker.ask(
        "counterfactual",
        words.outcomes[outcome],
        program,
        refers,
        thing=the(about),
        it="it" if what == about else the(about),
        change=done,
        change_of_it=of_it,
    )


def _loose(asker: Asker, thing: Thing) -> bool:
    world = asker.episode.world
    return world.bodies[world.entities[thing.entity].root].kind is BodyKind.FREE


def _outcome(asker: Asker, fork: Fork, thing: Thing) -> str:
    """`falls`, `moves` or `stays`; empty where it is not clear, or not the same at both times."""
    now = asker.moment
    found = {
        _became(now, Moment(now.world, now.things, now.viewer, poses, now.step), thing) for poses in fork.body_pose
    }
    return found.pop() if len(found) == 1 else ""


def _became(before: Moment, after: Moment, thing: Thing) -> str:
    root = before.world.entities[thing.entity].root
    a, b = (millimetres(moment.poses[root, :3]) for moment in (before, after))
    x, y, z = (abs(p - q) for p, q in zip(a, b, strict=True))
    drop = before.extent(thing.name).low[2] - after.extent(thing.name).low[2]
    if max(x, y, z, abs(drop)) <= STAYED:
        return "stays"
    if drop >= FALLEN:
        return "falls"
    return "moves" if abs(drop) <= STAYED and max(x, y) >= FALLEN else ""


def _part_outcome(asker: Asker, fork: Fork, instead: Fork | None = None) -> str:
    """`closes` or `stays`, of the part that a fork pushes shut, in that fork or in another; empty where unclear."""
    world = asker.episode.world
    j = next(k for k, one in enumerate(world.joints) if world.bodies[one.body].name == fork.change.part)
    lower, upper = world.joints[j].lower, world.joints[j].upper
    after, now = (instead or fork).joint_pos[:, j], asker.episode.joint_pos[asker.step, j]
    if ((after - lower) / (upper - lower) <= SHUT).all():
        return "closes"
    return "stays" if (np.abs(after - now) <= LEFT_OPEN * (upper - lower)).all() else ""
