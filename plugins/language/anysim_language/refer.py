"""Referring expressions: the shortest noun phrase that fits one thing of a scene and no other."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from anysim_language.moment import Moment
from anysim_language.things import Thing

ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth")
DIFFERS = 15
"""By how many percent the volume of a thing differs from all like it, to be called small or large."""
TELL_APART = 10
"""Things in a row are at least so far apart [mm], to be counted along it."""


class Reference(NamedTuple):
    """A phrase without its article, and what it says: empty words say nothing.

    `rank` is `smaller`, `largest` and so on; `place` an ordinal with its direction such as `second from the left`.
    """

    noun: str
    colour: str = ""
    material: str = ""
    rank: str = ""
    place: str = ""

    @property
    def phrase(self) -> str:
        """`smaller red metal mug that is second from the left`."""
        words = " ".join(word for word in (self.rank, self.colour, self.material, self.noun) if word)
        return f"{words} that is {self.place}" if self.place else words


def references(moment: Moment, things: Sequence[Thing] | None = None) -> dict[str, Reference]:
    """A reference to each thing by its logical name, each fitting one alone among `things` (default: all there are)."""
    among = tuple(moment.things if things is None else things)
    return {thing.name: _reference(moment, thing, among) for thing in among}


def _reference(moment: Moment, thing: Thing, among: Sequence[Thing]) -> Reference:
    noun = thing.words.several if thing.count > 1 else thing.words.noun
    alike = [t for t in among if (t.words.several if t.count > 1 else t.words.noun) == noun]
    made = Reference(noun)
    for field in ("colour", "material"):
        if len(alike) == 1:
            return made
        value: str = getattr(thing, field)
        same = [t for t in alike if getattr(t, field) == value]
        if value and len(same) < len(alike):
            made, alike = made._replace(**{field: value}), same
    if len(alike) == 1:
        return made
    rank = _rank(thing, alike)
    return made._replace(rank=rank) if rank else made._replace(place=_place(moment, thing, alike))


def volume(thing: Thing) -> int:
    """Of the box around it [mm³]."""
    x, y, z = thing.size
    return x * y * z


def _rank(thing: Thing, alike: Sequence[Thing]) -> str:
    """What its size is among things that are otherwise alike, where it stands out; robots have none."""
    others = [volume(t) for t in alike if t is not thing]
    own = volume(thing)
    if thing.robot:
        return ""
    if own * 100 >= max(others) * (100 + DIFFERS):
        return "largest" if len(others) > 1 else "larger"
    if own * (100 + DIFFERS) <= min(others) * 100:
        return "smallest" if len(others) > 1 else "smaller"
    return ""


def _place(moment: Moment, thing: Thing, alike: Sequence[Thing]) -> str:
    """Its number along the first direction in which all of them are apart; else along the first in which any are."""
    at = {t.name: moment.at(t.name) for t in alike}
    directions = (
        ("from the left", {name: -moment.viewer.lateral(point) for name, point in at.items()}),
        ("from the front", {name: moment.viewer.ahead(point) for name, point in at.items()}),
        ("from below", {name: point[2] for name, point in at.items()}),
    )
    for words, along in directions:
        order = sorted(along.values())
        if all(b - a >= TELL_APART for a, b in pairwise(order)):
            return _ordinal(order.index(along[thing.name]), len(order), words)
    keys = {name: (*(along[name] for _, along in directions), name) for name in at}
    return _ordinal(sorted(keys.values()).index(keys[thing.name]), len(keys), "from the left")


def _ordinal(number: int, count: int, words: str) -> str:
    if count == 2:
        pairs = {
            "from the left": ("on the left", "on the right"),
            "from the front": ("in front", "at the back"),
            "from below": ("below", "above"),
        }
        return pairs[words][number]
    ordinal = ORDINALS[number] if number < len(ORDINALS) else f"number {number + 1}"
    return f"{ordinal} {words}"
