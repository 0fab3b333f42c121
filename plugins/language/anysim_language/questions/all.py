"""All questions about an episode, each verified before it is given out."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from typing import NamedTuple

from anysim_language.check.answers import Checker
from anysim_language.choice import number
from anysim_language.episode import Episode
from anysim_language.questions.forks import Fork
from anysim_language.questions.otherwise import about_forks
from anysim_language.questions.past import Past
from anysim_language.questions.places import about_places
from anysim_language.questions.question import Asker, Question
from anysim_language.questions.reach import about_reach
from anysim_language.questions.sight import about_sight
from anysim_language.questions.things import about_things
from anysim_language.questions.times import about_time

FAMILIES = (about_things, about_places, about_sight, about_reach, about_time, about_forks)


class Verdict(NamedTuple):
    """A question, and whether its answer was found a second time by the independent checker."""

    question: Question
    agreed: bool


def questions_at(past: Past, step: int) -> Iterator[Question]:
    """What can be asked about a control step, family by family."""
    asker = Asker(past, step)
    for family in FAMILIES:
        yield from family(asker)


def verified(
    episode: Episode, steps: Sequence[int], seed: int = 0, forks: Mapping[int, Sequence[Fork]] | None = None
) -> Iterator[Verdict]:
    """All questions about some control steps, each with the checker's verdict; `forks` are those of `forked`."""
    past = Past(episode, seed, forks)
    with closing(Checker(episode)) as checker:
        for step in steps:
            for question in questions_at(past, step):
                yield Verdict(question, checker.verify(question))


def chosen(found: Sequence[Question], most: int, seed: int = 0) -> list[Question]:
    """At most so many questions, as evenly over the families as they come, in an order that follows from the seed."""
    by_family: dict[str, list[Question]] = {}
    for question in found:
        by_family.setdefault(question.family, []).append(question)
    for questions in by_family.values():
        questions.sort(key=lambda q: number(seed, q.family, q.step, q.text, q.answer))
    picked: list[Question] = []
    for turn in range(max(map(len, by_family.values()), default=0)):
        picked += [questions[turn] for _, questions in sorted(by_family.items()) if turn < len(questions)]
    return picked[:most]
