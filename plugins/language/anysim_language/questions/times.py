"""Questions about a recorded episode in time: what came first, what has changed so far, and what comes next."""

from collections.abc import Iterator
from itertools import combinations

from anysim_language.changes import OPEN, SHUT
from anysim_language.joints import movable_parts
from anysim_language.moment import millimetres
from anysim_language.questions.past import PHRASES
from anysim_language.questions.question import Asker, Question
from anysim_language.sentences import listed

APART = 20
"""Two events that are asked about are at least so many control steps apart."""
HAS_MOVED, HAS_STAYED = 50, 8
"""What has moved is at least so far [mm] from where it was, what has not at most so far; between nothing is asked."""
SETTLED = 3
"""Control steps on either side of a change at which nothing is asked about what comes next."""


def about_time(asker: Asker) -> Iterator[Question]:
    """All of them for one moment; none for an episode that has only begun."""
    if asker.episode.reader is None:
        return
    yield from _changed(asker)
    yield from _opened(asker)
    yield from _next(asker)
    if asker.step == len(asker.episode.body_pose) - 1:
        yield from _order(asker)


def _order(asker: Asker) -> Iterator[Question]:
    for a, b in combinations(asker.past.firsts, 2):
        if abs(a.step - b.step) < APART:
            continue
        words = [PHRASES[c.kind].format(asker.naming.the(c.what)) for c in (a, b)]
        first = 0 if a.step < b.step else 1
        program = {"a": [a.kind, a.what], "b": [b.kind, b.what], "first": "ab"[first]}
        refers = [c.what.partition(".")[0] for c in (a, b)]
        yield asker.ask("order", words[first], program, refers, a=words[0], b=words[1])


def _changed(asker: Asker) -> Iterator[Question]:
    before, now = asker.episode.first, asker.moment
    if asker.step == 0 or any(thing.count > 1 for thing in now.objects):
        return
    moved: list[str] = []
    for thing in now.objects:
        root = now.world.entities[thing.entity].root  # a drawer that opens does not move its cabinet
        places = (millimetres(moment.poses[root, :3]) for moment in (before, now))
        far = max(abs(a - b) for a, b in zip(*places, strict=True))
        if HAS_STAYED < far < HAS_MOVED:
            return
        if far >= HAS_MOVED:
            moved.append(thing.name)
    answer = listed([asker.naming.the(name) for name in moved]) if moved else "nothing"
    yield asker.ask("changed", answer, {"moved": moved}, moved)


def _opened(asker: Asker) -> Iterator[Question]:
    world = asker.episode.world
    for thing in asker.objects:
        for part in movable_parts(world, thing.entity):
            travel = asker.episode.joint_pos[: asker.step + 1, part.joint] - part.lower
            share = travel / (part.upper - part.lower)
            if part.done != "opened" or share[0] > SHUT or SHUT < share.max() < OPEN:
                continue
            answer = "yes" if share.max() >= OPEN else "no"
            program = {"joint": world.joints[part.joint].name}
            yield asker.ask("opened", answer, program, (thing.name,), part=asker.naming.the(part.name))


def _next(asker: Asker) -> Iterator[Question]:
    told = asker.past.doings
    if any(abs(sentence.step - asker.step) <= SETTLED for sentence in told):
        return
    later = [sentence for sentence in told if sentence.step > asker.step]
    if later and later[0].who:
        program = {"kind": later[0].kind, "what": later[0].what, "step": later[0].step}
        robot = asker.naming.the(later[0].who)
        yield asker.ask("next", later[0].text, program, (later[0].who,), robot=robot)
