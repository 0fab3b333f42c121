"""Questions about what there is: how many, whether any, which colour, what material."""

from collections.abc import Iterator

from anysim_language.questions.question import Asker, Question
from anysim_language.sentences import counted, indefinite
from anysim_language.things import Thing

PALETTE = ("red", "green", "blue", "yellow", "orange", "purple", "white", "black")
MATERIALS = {
    "metal": "metal",
    "wooden": "wood",
    "glass": "glass",
    "rubber": "rubber",
    "plastic": "plastic",
    "ceramic": "ceramic",
}
"""What a thing with an adjective is made of."""


def about_things(asker: Asker) -> Iterator[Question]:
    """All of them for one moment."""
    yield from _count(asker)
    yield from _exist(asker)
    yield from _attributes(asker)


def _kinds(asker: Asker) -> dict[str, list[Thing]]:
    """The objects by noun."""
    found: dict[str, list[Thing]] = {}
    for thing in asker.moment.objects:
        found.setdefault(thing.words.noun, []).append(thing)
    return found


def _count(asker: Asker) -> Iterator[Question]:
    for noun, things in _kinds(asker).items():
        if any(thing.count > 1 for thing in things):
            continue
        several = things[0].words.several
        yield asker.ask("count", counted(len(things)), {"noun": noun, "colour": ""}, (), things=several)
        if len(things) > 1 and all(thing.colour_clear for thing in things):
            for colour in sorted({thing.colour for thing in things}):
                number = sum(thing.colour == colour for thing in things)
                program = {"noun": noun, "colour": colour}
                yield asker.ask("count", counted(number), program, (), things=f"{colour} {several}")


def _exist(asker: Asker) -> Iterator[Question]:
    for noun, things in _kinds(asker).items():
        if any(thing.count > 1 or not thing.colour_clear for thing in things):
            continue
        here = {thing.colour for thing in things}
        absent = [colour for colour in PALETTE if colour not in here]
        for colour in (min(here), absent[(asker.step + len(noun)) % len(absent)]):
            program = {"noun": noun, "colour": colour}
            phrase = indefinite(f"{colour} {noun}")
            yield asker.ask("exist", "yes" if colour in here else "no", program, (), thing=phrase)


def _attributes(asker: Asker) -> Iterator[Question]:
    for thing in asker.objects:
        phrase = asker.without_colour(thing)
        if phrase and thing.colour_clear:
            yield asker.ask("colour", thing.colour, {"thing": thing.name}, (thing.name,), thing=phrase)
        if thing.material in MATERIALS and not asker.naming.references[thing.name].material:
            answer = MATERIALS[thing.material]
            the = asker.naming.the(thing.name)
            yield asker.ask("material", answer, {"thing": thing.name}, (thing.name,), thing=the)
