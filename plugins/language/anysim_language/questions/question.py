"""A question with its answer and its meaning, and what asks: one moment of an episode, with words and a seed."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from anysim_language.choice import choose, ordered
from anysim_language.naming import Naming
from anysim_language.questions.past import Past
from anysim_language.refer import Reference
from anysim_language.relations import Support, support
from anysim_language.sentences import capital, render
from anysim_language.things import Thing

SURE = 4
"""Nothing is asked that would have another answer if something were elsewhere by less than this [mm]."""


class Question(NamedTuple):
    """A question about one control step.

    Attributes:
        family: such as `count`.
        text, answer: in words.
        step: the control step that it is asked at; answers look back from it, or ahead where the question says so.
        program: its meaning in logical names, from which the answer is found a second time.
        refers: the logical names by the phrases that stand for them, without articles.
    """

    family: str
    text: str
    answer: str
    step: int
    program: Mapping[str, Any]
    refers: Mapping[str, str]


class Asker:
    """One moment of an episode to ask about.

    Attributes:
        past: what happened in the episode.
        episode, step: what is asked about.
        moment: the things at that step.
        objects: those that are single things, in an order that follows from the seed.
    """

    def __init__(self, past: Past, step: int) -> None:
        self.past, self.episode, self.step, self.seed = past, past.episode, step, past.seed
        episode, seed = past.episode, past.seed
        self.moment = episode.moment(step)
        self.naming = Naming(self.moment, episode.vocabulary.words, dict(episode.goal_frames))
        single = [thing for thing in self.moment.objects if thing.count == 1]
        self.objects: Sequence[Thing] = ordered(single, seed, episode.name, step)
        self._supports = {thing.name: support(self.moment, thing) for thing in single}

    def ask(
        self, family: str, answer: str, program: Mapping[str, Any], refers: Sequence[str] = (), /, **values: object
    ) -> Question:
        """A question of a family: a phrasing with its values, and the references in it."""
        key = (self.episode.name, "question", family, self.step, *sorted(map(str, program.items())))
        template = choose(self.episode.vocabulary.words.questions[family], self.seed, *key)
        phrases = {self.naming.references[name].phrase: name for name in refers}
        return Question(family, capital(render(template, values)), answer, self.step, dict(program), phrases)

    def held(self, name: str) -> Support | None:
        """What a thing lies on or in, where that is sure; None also for what is in the air."""
        found = self._supports.get(name)
        return found if found is not None and found.slack >= SURE else None

    def unsure(self, name: str) -> bool:
        """Whether what carries a thing is not sure."""
        found = self._supports.get(name)
        return found is None or found.slack < SURE

    def together(self, name: str) -> list[str]:
        """The single things on or in the same as a thing, itself among them; empty where any of it is not sure."""
        own = self.held(name)
        if own is None or any(self.unsure(t.name) and self._could_be(t.name, own) for t in self.objects):
            return []
        alike = [t for t in self.moment.objects if t.count > 1]
        return [] if alike else [t.name for t in self.objects if self._same(t.name, own)]

    def _same(self, name: str, own: Support) -> bool:
        held = self.held(name)
        return held is not None and (held.relation, held.where) == (own.relation, own.where)

    def _could_be(self, name: str, own: Support) -> bool:
        """Whether a thing of which it is not sure what carries it may be on or in the same as others."""
        found = self._supports.get(name)
        return found is not None and found.where.partition(".")[0] == own.where.partition(".")[0]

    def place(self, where: str) -> str:
        """The words for what carries something."""
        return "the ground" if where == "ground" else self.naming.the(where)

    def without_colour(self, thing: Thing) -> str:
        """A phrase for a thing that does not tell its colour; empty where it takes that to tell it from others."""
        reference = self.naming.references[thing.name]
        if reference.colour:
            return ""
        return f"the {Reference(reference.noun, '', reference.material, reference.rank, reference.place).phrase}"
