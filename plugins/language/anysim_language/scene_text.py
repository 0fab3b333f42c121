"""L1: what there is, how it looks, and where it is, as sentences from facts in a fixed order."""

from collections.abc import Callable

from anysim_language.changes import OPEN
from anysim_language.choice import choose
from anysim_language.episode import Episode
from anysim_language.joints import movable_parts
from anysim_language.moment import Moment
from anysim_language.naming import Naming
from anysim_language.relations import GROUND, NEAR, direction, gap, support
from anysim_language.sentences import capital, counted, indefinite, listed, render

Say = Callable[..., str]
"""A sentence of a kind, with the values of its template."""
GROUP = 3
"""So many things that look alike are spoken of together."""
MOST_PAIRS = 6
"""Sentences about how things stand to each other, at most."""


def scene_text(episode: Episode, seed: int = 0, step: int = 0) -> str:
    """The scene at a control step, as text.

    Args:
        episode: to speak of.
        seed: chooses among phrasings; the facts stay the same.
        step: 0 is right after the reset, -1 the last one.
    """
    moment = episode.moment(step)
    words = episode.vocabulary.words
    naming = Naming(moment, words, dict(episode.goal_frames))

    def say(kind: str, *key: object, **values: object) -> str:
        template = choose(words.scene[kind], seed, episode.name, "L1", kind, *key)
        return capital(render(template, {**naming.functions(), **values}))

    return " ".join(_sentences(episode, moment, naming, say))


def _sentences(episode: Episode, moment: Moment, naming: Naming, say: Say) -> list[str]:
    robots = [thing.name for thing in moment.things if thing.robot]
    groups = _groups(moment)
    found: list[str] = []
    if groups:
        one = len(robots) == 1
        things = [_group_phrase(moment, naming, names) for names in groups]
        number = sum(map(len, groups))
        verbs = {"stands": "stands" if one else "stand", "act": "is" if one else "are"}
        kind = "opening" if robots else "things_alone"
        amount = f"{counted(number)} thing{'s' if number != 1 else ''}"
        found.append(say(kind, robot=_robots(naming, robots), things=things, amount=amount, **verbs))
    else:
        found.append(
            say("robots_alone", robots=_robots(naming, robots), stands="stands" if len(robots) == 1 else "stand")
        )
    found += _supports(moment, naming, groups, say)
    pairs = _pairs(moment, naming, [names[0] for names in groups if len(names) == 1], say)
    found += pairs[:MOST_PAIRS]
    if pairs and moment.viewer.name:
        found.append(say("viewpoint", viewer=naming.the(moment.viewer.name)))
    for thing in moment.objects:
        if thing.words.about:
            found.append(say("about", thing.name, about=_about(naming.the(thing.name), thing.words.about)))
    found += [say("joint", part, part=naming.the(part)) for part in _open_parts(episode, moment)]
    if episode.views:
        names = [indefinite(f"{view.name.replace('_', ' ')} camera") for view in episode.views]
        found.append(say("camera", cameras=names, single=len(names) == 1))
    if episode.lights:
        found.append(say("light", count=f"{counted(episode.lights)} light{'s' if episode.lights > 1 else ''}"))
    return found


def _robots(naming: Naming, robots: list[str]) -> str:
    """`a Panda arm`, `two Panda arms`, or one by one."""
    words = {naming.moment.by_name[name].words.several for name in robots}
    if len(robots) > 1 and len(words) == 1:
        return f"{counted(len(robots))} {words.pop()}"
    return listed([naming.an(name) for name in robots])


def _about(the: str, about: str) -> str:
    """A clause such as `it can be pushed` or `its cap can be pressed` with its thing in place of the pronoun."""
    for pronoun, phrase in (("it ", f"{the} "), ("its ", f"{the}'s ")):
        if about.startswith(pronoun):
            return phrase + about.removeprefix(pronoun)
    return f"of {the}: {about}"


def _open_parts(episode: Episode, moment: Moment) -> list[str]:
    """Parts that stand open, of those that are opened and closed."""
    return [
        part.name
        for thing in moment.objects
        for part in movable_parts(episode.world, thing.entity)
        if part.done == "opened"
        and episode.joint_pos[moment.step, part.joint] >= part.lower + OPEN * (part.upper - part.lower)
    ]


def _groups(moment: Moment) -> list[list[str]]:
    """The objects, those that look alike and lie on the same in one group where they are three or more."""
    alike: dict[tuple[object, ...], list[str]] = {}
    for thing in moment.objects:
        held = support(moment, thing)
        key = (thing.words.noun, thing.colour, thing.material, thing.size, held and (held.relation, held.where))
        alike.setdefault(key, []).append(thing.name)
    groups: list[list[str]] = []
    for names in alike.values():
        groups += [names] if len(names) >= GROUP else [[name] for name in names]
    order = {thing.name: k for k, thing in enumerate(moment.things)}
    return sorted(groups, key=lambda names: order[names[0]])


def _group_phrase(moment: Moment, naming: Naming, names: list[str], definite: bool = False) -> str:
    if len(names) == 1:
        return naming.the(names[0]) if definite else naming.an(names[0])
    thing = moment.by_name[names[0]]
    words = " ".join(word for word in (thing.colour, thing.material, thing.words.several) if word)
    return f"the {counted(len(names))} {words}" if definite else f"{counted(len(names))} {words}"


def _supports(moment: Moment, naming: Naming, groups: list[list[str]], say: Say) -> list[str]:
    """What lies on or in what, all of one place in one sentence."""
    places: dict[tuple[str, str], list[list[str]]] = {}
    for names in groups:
        held = support(moment, moment.by_name[names[0]])
        if held is not None:
            places.setdefault((held.relation, held.where), []).append(names)
    return [
        say(
            "support",
            relation,
            where,
            what=[_group_phrase(moment, naming, names, definite=True) for names in here],
            single=len(here) == 1 and len(here[0]) == 1 and moment.by_name[here[0][0]].count == 1,
            relation=relation,
            where="the ground" if where == GROUND else naming.the(where),
        )
        for (relation, where), here in places.items()
    ]


def _pairs(moment: Moment, naming: Naming, names: list[str], say: Say) -> list[str]:
    """How things on the same support stand to each other, each pair once."""
    carried = [(name, support(moment, moment.by_name[name])) for name in names if moment.by_name[name].count == 1]
    sides: list[str] = []
    close: list[str] = []
    for k, (a, on_a) in enumerate(carried):
        for b, on_b in carried[k + 1 :]:
            if on_a is None or on_b is None or (on_a.relation, on_a.where) != (on_b.relation, on_b.where):
                continue
            side, _ = direction(moment, a, b)
            if side in ("left", "behind"):
                sides.append(say(side, a, b, a=naming.the(a), b=naming.the(b)))
            elif side:
                other = {"right": "left", "before": "behind"}[side]
                sides.append(say(other, b, a, a=naming.the(b), b=naming.the(a)))
            if gap(moment.extent(a), moment.extent(b)) <= NEAR:
                close.append(say("near", a, b, a=naming.the(a), b=naming.the(b)))
    return [*sides, *close]
