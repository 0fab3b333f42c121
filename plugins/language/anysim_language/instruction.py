"""L2: the task as an instruction, with what was drawn for the episode; several phrasings that mean the same."""

import re

from anysim_language.choice import choose
from anysim_language.episode import Deed, Episode
from anysim_language.naming import Naming
from anysim_language.sentences import capital, listed, render

_OF_THE_LAST = re.compile(r"\w+ it\b")
"""A clause about what the one before it names: `put it into the tray`."""


def instruction_text(episode: Episode, seed: int = 0) -> str:
    """One of the phrasings, chosen by a seed."""
    return choose(instructions(episode), seed, episode.name, "L2")


def instructions(episode: Episode) -> list[str]:
    """The phrasings: the task's own words first, then those that the vocabulary has for it, else for its commands.

    A task one of whose commands has no words keeps its own alone, as does one whose several commands are all minor.
    """
    own, words = [episode.instruction] if episode.instruction else [], episode.vocabulary.words
    if episode.name in words.tasks:
        naming = Naming(episode.first, words, dict(episode.goal_frames))
        return own + [capital(f"{render(text, naming.functions())}.") for text in words.tasks[episode.name]]
    if not episode.deeds or any(deed.skill not in words.skills for deed in episode.deeds):
        return own or ["Do nothing."]
    major = [deed for deed in episode.deeds if not words.skills[deed.skill].minor]
    if not major and own and len(episode.deeds) > 1:
        return own
    major = major or list(episode.deeds)
    most = max(len(words.skills[deed.skill].do) for deed in major)
    return list(dict.fromkeys(own + [_sentence(episode, major, k) for k in range(most)]))


def _sentence(episode: Episode, deeds: list[Deed], number: int) -> str:
    """All deeds; a clause about `it` belongs to the one before."""
    naming = Naming(episode.first, episode.vocabulary.words, dict(episode.goal_frames))
    clauses: list[str] = []
    for deed in deeds:
        templates = episode.vocabulary.words.skills[deed.skill].do
        clause = clause_of(naming, templates[number % len(templates)], deed)
        if clauses and _OF_THE_LAST.match(clause):
            clauses[-1] += f" and {clause}"
        elif not clauses or clause != clauses[-1]:
            clauses.append(clause)
    if len(clauses) == 1 or (len(clauses) <= 3 and not any(" and " in clause for clause in clauses)):
        return capital(f"{listed(clauses)}.")
    starts = ["First", *["Then"] * (len(clauses) - 2), "Then" if len(clauses) == 2 else "Finally"]
    return " ".join(f"{start} {clause}." for start, clause in zip(starts, clauses, strict=True))


def clause_of(naming: Naming, template: str, deed: Deed) -> str:
    """A clause about a skill with its parameters filled in; those that it was not given are None."""
    given = {key: value for key, value in deed.params.items() if key not in naming.functions()}
    return render(template, {**given, **naming.functions()}, optional=True)
