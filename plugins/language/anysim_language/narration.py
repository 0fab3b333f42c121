"""L3: what happens in a recorded episode, one sentence at each change point, from its states and its skills' phases."""

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

from anysim_language.changes import changes
from anysim_language.choice import choose
from anysim_language.episode import Deed, Episode
from anysim_language.instruction import clause_of
from anysim_language.naming import Naming
from anysim_language.relations import GROUND
from anysim_language.sentences import capital, render

_COMMAND = re.compile(r"(\d+) (\w+)(?:: |$)")
"""The beginning of a phase in a list of commands: `5 release: retreat`."""


class Sentence(NamedTuple):
    """What begins at a control step, in words, and the facts that it is made of; `who` is the robot that acts."""

    step: int
    text: str
    kind: str
    what: str = ""
    where: str = ""
    who: str = ""


def narration(episode: Episode, seed: int = 0) -> list[Sentence]:
    """The sentences in order; one that says what the last one of its kind said is left out."""
    naming = Naming(episode.first, episode.vocabulary.words, dict(episode.goal_frames))
    words = episode.vocabulary.words
    said: list[Sentence] = []

    def say(step: int, kind: str, what: str = "", where: str = "", who: str = "", /, **values: str) -> None:
        template = choose(words.events[kind], seed, episode.name, "L3", kind, what, where)
        said.append(Sentence(step, capital(render(template, values)), kind, what, where, who))

    last: tuple[str, str] = ("", "")
    for step, annotation in enumerate(episode.annotations, 1):
        deed, name, phase = _deed(episode, annotation)
        who = _who(episode, naming, deed, str(annotation.get("phase", "")))
        robot = naming.the(who) if who else "the robot"
        if deed is not None and name != last[0]:
            doing = choose(words.skills[deed.skill].doing, seed, episode.name, "L3", "doing", name)
            say(step, "began", name, "", who, robot=robot, doing=clause_of(naming, doing, deed))
        elif (name, phase) != last and phase in words.phases:
            what = _what(naming, deed)
            if what or "what" not in words.phases[phase]:  # a skill of several objects does not say which one
                say(step, "phase", phase, "", who, robot=robot, doing=render(words.phases[phase], {"what": what}))
        last = (name, phase)
    for change in changes(episode):
        where = "the ground" if change.where in (GROUND, "") else naming.the(change.where)
        phrase = naming.the(change.what)
        say(
            change.step,
            change.kind,
            change.what,
            change.where,
            thing=phrase,
            part=phrase,
            where=where,
            relation=change.relation,
            robot=where,
        )
    if episode.status in words.events:
        say(len(episode.body_pose) - 1, episode.status)
    said.sort(key=lambda one: one.step)  # stable: phases before states, in their order
    return [one for k, one in enumerate(said) if k == 0 or one.text != said[k - 1].text]


def _deed(episode: Episode, annotation: Mapping[str, Any]) -> tuple[Deed | None, str, str]:
    """The deed under way, a name that changes with it, and the phase."""
    phase = str(annotation.get("phase", ""))
    skill, number = str(annotation.get("skill", "")), 0
    command = _COMMAND.match(phase)
    if command is not None:
        number, skill = int(command[1]), command[2]
    known = [deed for deed in episode.deeds if deed.skill == skill and skill in episode.vocabulary.words.skills]
    exact = episode.deeds[number - 1] if 0 < number <= len(episode.deeds) else None
    deed = exact if exact is not None and exact in known else known[0] if known else None
    return deed, f"{number} {skill}", phase.rpartition(": ")[2]


def _who(episode: Episode, naming: Naming, deed: Deed | None, phase: str) -> str:
    """The robot that acts in a phase such as `take: descend`: that of its deed, else the first; empty for none."""
    if deed is not None:
        actors = episode.vocabulary.words.skills[deed.skill].actors
        part = next((part for part in phase.split(": ") if part in actors), "")
        named = naming.owner(deed.params.get(actors.get(part, "robot")))
        if named:
            return named
    return episode.viewer.name


def _what(naming: Naming, deed: Deed | None) -> str:
    """What a phase is about: the object of its deed; empty where it names none."""
    for key in ("object", "part", "button", "vessel"):
        name = deed.params.get(key) if deed is not None else None
        if isinstance(name, str) and naming.owner(name):
            return naming.the(name)
    return ""
