"""References read back: which things of a scene a phrase fits, found from the words alone and raw numbers."""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from anysim.conventions import Array
from anysim_language.check.scene import RawScene
from anysim_language.things import Thing

_PHRASE = re.compile(r"(?:(?P<rank>smaller|smallest|larger|largest) )?(?P<words>.+?)(?: that is (?P<place>.+))?$")
_ORDINAL = re.compile(
    r"(?:number (?P<number>\d+)|(?P<word>\w+)) (?P<direction>from the left|from the front|from below)$"
)
_WORDS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth")
_PAIRS = {
    "on the left": ("from the left", 0),
    "on the right": ("from the left", 1),
    "in front": ("from the front", 0),
    "at the back": ("from the front", 1),
    "below": ("from below", 0),
    "above": ("from below", 1),
}


def resolve(phrase: str, things: Sequence[Thing], scene: RawScene, origin: Array, forward: Array) -> list[str]:
    """The logical names of the things that a phrase without its article fits.

    `origin` (3,) [m] and `forward` (3,) are where the viewer stands and looks.
    """
    found = _PHRASE.match(phrase)
    assert found is not None
    alike = [thing for thing in things if _fits(found["words"], thing)]
    if found["rank"]:
        alike = _ranked(found["rank"], alike)
    if found["place"]:
        alike = _placed(found["place"], alike, scene, origin, forward)
    return [thing.name for thing in alike]


def _fits(words: str, thing: Thing) -> bool:
    """Whether words are a thing's noun with any of its adjectives in front, in their order."""
    noun = thing.words.noun if thing.count == 1 else (thing.words.plural or f"{thing.words.noun}s")
    adjectives = [word for word in (thing.colour, thing.material) if word]
    forms = {noun}
    if thing.colour:
        forms.add(f"{thing.colour} {noun}")
    if thing.material:
        forms.add(f"{thing.material} {noun}")
    if len(adjectives) == 2:
        forms.add(f"{adjectives[0]} {adjectives[1]} {noun}")
    return words in forms


def _ranked(rank: str, alike: Sequence[Thing]) -> list[Thing]:
    """Those whose volume alone is the least or the greatest, by more than a tenth."""
    volumes = np.array([float(np.prod(np.array(thing.size, dtype=float))) for thing in alike])
    order = np.argsort(volumes)
    picked, next_one = (order[0], order[1]) if rank.startswith("small") else (order[-1], order[-2])
    ratio = volumes[next_one] / volumes[picked]
    clear = max(ratio, 1.0 / ratio) > 1.1
    right_number = (len(alike) == 2) == (rank in ("smaller", "larger"))
    return [alike[int(picked)]] if clear and right_number else list(alike)


def _placed(place: str, alike: Sequence[Thing], scene: RawScene, origin: Array, forward: Array) -> list[Thing]:
    if place in _PAIRS:
        direction, number = _PAIRS[place]
        if len(alike) != 2:
            return list(alike)
    else:
        ordinal = _ORDINAL.match(place)
        assert ordinal is not None, place
        direction = ordinal["direction"]
        number = int(ordinal["number"]) - 1 if ordinal["number"] else _WORDS.index(ordinal["word"])
    at = {t.name: scene.middle(t.entity, t.robot) - origin for t in alike}
    right = np.array([forward[1], -forward[0], 0.0])
    keys: Mapping[str, Array] = {
        "from the left": right,
        "from the front": forward,
        "from below": np.array([0.0, 0.0, 1.0]),
    }
    order = sorted(alike, key=lambda t: float(at[t.name] @ keys[direction]))
    return [order[number]] if number < len(order) else []
