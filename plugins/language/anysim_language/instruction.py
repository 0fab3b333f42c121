"""L2: the task as an instruction, with what was drawn for the episode; several phrasings that mean the same."""

from anysim_language.choice import choose
from anysim_language.episode import Deed, Episode
from anysim_language.naming import Naming
from anysim_language.sentences import capital, listed, render


def instruction_text(episode: Episode, seed: int = 0) -> str:
    """One of the phrasings, chosen by a seed."""
    return choose(instructions(episode), seed, episode.name, "L2")


def instructions(episode: Episode) -> list[str]:
    """The phrasings: the task's own words first, then those that its commands have in the vocabulary.

    A task one of whose commands has no words keeps its own alone.
    """
    own = [episode.instruction] if episode.instruction else []
    skills = episode.vocabulary.words.skills
    if not episode.deeds or any(deed.skill not in skills for deed in episode.deeds):
        return own or ["Do nothing."]
    major = [deed for deed in episode.deeds if not skills[deed.skill].minor] or list(episode.deeds)
    most = max(len(skills[deed.skill].do) for deed in major)
    return own + [sentence for k in range(most) if (sentence := _sentence(episode, major, k))]


def _sentence(episode: Episode, deeds: list[Deed], number: int) -> str:
    naming = Naming(episode.first, episode.vocabulary.words, dict(episode.goal_frames))
    clauses: list[str] = []
    for deed in deeds:
        templates = episode.vocabulary.words.skills[deed.skill].do
        clause = clause_of(naming, templates[number % len(templates)], deed)
        if not clauses or clause != clauses[-1]:
            clauses.append(clause)
    if len(clauses) <= 3:
        return capital(f"{listed(clauses)}.")
    return " ".join(
        f"{'First' if k == 0 else 'At last' if k == len(clauses) - 1 else 'Then'} {clause}."
        for k, clause in enumerate(clauses)
    )


def clause_of(naming: Naming, template: str, deed: Deed) -> str:
    """A clause about a skill with its parameters filled in; those that it was not given are None."""
    given = {key: value for key, value in deed.params.items() if key not in naming.functions()}
    return render(template, {**given, **naming.functions()}, optional=True)
