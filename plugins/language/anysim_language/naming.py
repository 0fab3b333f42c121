"""Words for names: `cabinet.drawer_1` as `the top drawer of the cabinet`, with references that fit one thing alone."""

from collections.abc import Callable, Iterable
from typing import Any

from anysim_language.moment import Moment
from anysim_language.refer import references
from anysim_language.sentences import article, listed
from anysim_language.vocabulary import VocabularySpec

WORLD_WORDS = {"ground": "the ground", "terrain": "the ground", "room": "the room"}


class Naming:
    """Phrases for things, their parts and goals at one moment. Templates call its methods by their names."""

    def __init__(self, moment: Moment, words: VocabularySpec, goal_frames: dict[str, str] | None = None) -> None:
        self.moment, self.words = moment, words
        self.references = references(moment)
        self._goals = goal_frames or {}
        self._said = ""

    def functions(self) -> dict[str, Callable[..., Any]]:
        """What templates may call."""
        return {
            "the": self.the,
            "an": self.an,
            "it": self.it,
            "onto": self.onto,
            "to": self.to,
            "all": self.all,
            "owner": self.owner,
            "plural": self.plural,
        }

    def the(self, name: object) -> str:
        """A thing, a part of one, or a goal, with its article."""
        text = str(name).partition("/")[0]
        owner, _, part = text.partition(".")
        reference = self.references.get(owner)
        if reference is not None:
            self._said = owner
            whole = f"the {reference.phrase}"
            return self._part(owner, part, whole) if part and part != "inside" else whole
        alike = [t for t in self.moment.things if t.name.rpartition("_")[0] == owner]
        if alike:
            return f"the {alike[0].words.several}"
        if text in WORLD_WORDS:
            return WORLD_WORDS[text]
        frame = self._goals.get(text)
        return self.the(frame) if frame is not None and self.owner(frame) else "the goal"

    def an(self, name: str) -> str:
        """A thing with `a` or `an`; with `the` where a place tells it from others."""
        reference = self.references[name]
        thing = self.moment.by_name[name]
        if reference.place or reference.rank:
            return f"the {reference.phrase}"
        words = " ".join(w for w in (thing.colour, thing.material, reference.noun) if w)
        return words if thing.count > 1 else f"{article(words)} {words}"

    def it(self, name: object) -> str:
        """`it` for the thing that was spoken of last."""
        return "it" if name is not None and str(name).partition(".")[0] == self._said else self.the(name)

    def onto(self, name: object) -> str:
        """Where something is put."""
        text = self._goals.get(str(name), str(name))
        owner = self.owner(text)
        if not owner:
            return self.to(text)
        holds = text.endswith(".inside") or self.moment.by_name[owner].words.container
        before = self._said
        where = self.the(text.removesuffix(".inside"))
        self._said = before
        return f"{'into' if holds else 'onto'} {where}"

    def to(self, name: object) -> str:
        """Where something is brought."""
        before = self._said
        where = self.the(name)
        self._said = before
        return f"to {where}"

    def all(self, names: Iterable[str]) -> str:
        """Several things."""
        return listed([self.the(name) for name in names])

    def owner(self, name: object) -> str:
        """The logical name of the thing that a name is of; empty for a goal."""
        owner = str(name).partition(".")[0].partition("/")[0]
        return owner if owner in self.references else ""

    def plural(self, name: object) -> str:
        """The plural of a category or thing."""
        alike = [t for t in self.moment.things if t.name == name or t.name.rpartition("_")[0] == name]
        return alike[0].words.several if alike else f"{str(name).replace('_', ' ')}s"

    def _part(self, owner: str, part: str, whole: str) -> str:
        """`the handle of the top drawer of the cabinet`."""
        known = self.moment.by_name[owner].words.parts
        if part in known:
            return f"the {known[part]} of {whole}"
        before, _, last = part.rpartition(".")
        words = known.get(last) or self.words.parts.get(last) or last.replace("_", " ")
        return f"the {words} of {self._part(owner, before, whole) if before else whole}"
