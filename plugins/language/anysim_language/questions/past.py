"""The past of an episode: what happened in it, found once for all of its moments."""

from collections.abc import Mapping, Sequence
from functools import cached_property

from anysim_language.changes import Change, changes
from anysim_language.episode import Episode
from anysim_language.narration import Sentence, narration
from anysim_language.questions.forks import Fork

PHRASES = {kind: f"{{}} is {kind}" for kind in ("lifted", "opened", "closed", "turned", "pressed")}
"""Kinds of changes that may be asked about, as clauses."""


class Past:
    """The changes and deeds of an episode; `seed` chooses among phrasings.

    `forks` are those of control steps at which it may be asked what would be otherwise.
    """

    def __init__(self, episode: Episode, seed: int, forks: Mapping[int, Sequence[Fork]] | None = None) -> None:
        self.episode, self.seed, self.forks = episode, seed, forks or {}

    @cached_property
    def firsts(self) -> tuple[Change, ...]:
        """The first change of each kind of each thing, of the kinds that may be asked about."""
        found: dict[tuple[str, str], Change] = {}
        for change in changes(self.episode):
            if change.kind in PHRASES:
                found.setdefault((change.kind, change.what), change)
        return tuple(found.values())

    @cached_property
    def doings(self) -> tuple[Sentence, ...]:
        """What the robot does one after the other, in words."""
        return tuple(s for s in narration(self.episode, self.seed) if s.kind in ("began", "phase"))
