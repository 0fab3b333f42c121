"""The pair rule of `anysim.conventions`, for a library that averages.

Such a library (PhysX) gives a pair of shapes the mean of their coefficients. The rule wants the larger one, or that of
the higher priority, and no single coefficient per shape gives that for all pairs. So a geom becomes one shape for each
value that its pairs can have: shapes of a value carry it on both sides, where the mean is the value itself, and
collision groups let shapes meet only in the value of their pair.

Two shapes meet where the `kind` bits of one and the `meets` bits of the other have a bit in common.
"""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import EngineError
from anysim.model.pairs import pair_friction, pair_restitution
from anysim.model.world import Surface

BITS = 32
"""Collision groups of a shape."""


class Touch(NamedTuple):
    """What touching surfaces have in common: coefficients of friction and restitution."""

    friction: float
    restitution: float


class Copy(NamedTuple):
    """One shape of a geom: its surface, and the bits that say which others it meets."""

    touch: Touch
    kind: int
    meets: int


class _Class(NamedTuple):
    """Geoms that behave alike: the same surface, and all fixed or all movable."""

    friction: float
    restitution: float
    priority: int
    label: int


_Bits = dict[Touch, tuple[int, int]]
"""The shapes of one class, for its movable or its fixed geoms: value to (kind, meets)."""


def copies_of(
    surfaces: Sequence[Surface],
    frictions: Array,
    fixed: Array,
    may_meet: Array,
    labels: Sequence[int] = (),
    between: Collection[tuple[int, int]] = (),
) -> list[list[Copy]]:
    """The shapes of each of G geoms.

    Args:
        surfaces: what the World says.
        frictions: (G,) those in force, which may differ from the surfaces' own.
        fixed: (G,) bool, geoms that nothing moves; two of them never meet.
        may_meet: (G, G) bool; a geom gets no shape for a value that none of its pairs can have.
        labels: (G,) of the geoms' bodies, as in `exclusion_groups.Apart`; none where it is empty.
        between: pairs of labels, both ways, that never meet.

    Raises:
        EngineError: more different pairs than there are bits.
    """
    keys = [
        _Class(float(f), s.restitution, s.priority, label)
        for s, f, label in zip(surfaces, frictions, labels or [0] * len(surfaces), strict=True)
    ]
    classes = sorted(set(keys))
    friction, restitution, priority = (np.array([key[i] for key in classes]) for i in range(3))
    rule = pair_friction(friction, priority).tolist(), pair_restitution(restitution).tolist()

    def pair(first: _Class, second: _Class) -> Touch:
        i, k = number[first], number[second]
        return Touch(rule[0][i][k], rule[1][i][k])

    number = {key: i for i, key in enumerate(classes)}
    movable = {c for c, still in zip(keys, fixed, strict=True) if not still}
    still = {c for c, f in zip(keys, fixed, strict=True) if f}
    loose: dict[_Class, _Bits] = {c: {} for c in classes}
    stuck: dict[_Class, _Bits] = {c: {} for c in classes}
    next_bit = iter(range(BITS))

    def bit() -> int:
        number = next(next_bit, None)
        if number is None:
            raise EngineError(
                f"the {len(classes)} different surfaces of this world meet in more ways than the {BITS} collision "
                f"groups can keep apart; give more geoms the same friction, restitution and priority"
                + (", or exclude fewer pairs" if between else "")
            )
        return 1 << number

    def add(shapes: _Bits, touch: Touch, kind: int = 0, meets: int = 0) -> None:
        before = shapes.get(touch, (0, 0))
        shapes[touch] = (before[0] | kind, before[1] | meets)

    def meet(touch: Touch, first: _Class, seconds: Sequence[_Class]) -> None:
        """Movable geoms of `first` meet all of `seconds`, its fixed ones the movable of `seconds`."""
        seconds = [second for second in seconds if (first.label, second.label) not in between]
        if first in movable and seconds:
            mark = bit()
            add(loose[first], touch, kind=mark)
            for second in seconds:
                add(loose[second], touch, meets=mark)
                add(stuck[second], touch, meets=mark)
        if first in still and any(second in movable for second in seconds):
            mark = bit()
            add(stuck[first], touch, kind=mark)
            for second in seconds:
                add(loose[second], touch, meets=mark)

    mixed: list[tuple[_Class, _Class]] = []
    for place, first in enumerate(classes):
        own = Touch(first.friction, first.restitution)
        meet(own, first, [c for c in classes if pair(first, c) == own])
        for second in classes[place + 1 :]:
            if pair(first, second) not in (own, Touch(second.friction, second.restitution)):
                mixed.append((first, second))
    for first, second in mixed:
        meet(pair(first, second), first, [second])
    partners = [{keys[k] for k in np.flatnonzero(row)} for row in may_meet]
    result: list[list[Copy]] = []
    for key, is_fixed, others in zip(keys, fixed, partners, strict=True):
        wanted = {pair(key, other) for other in others}
        bits = (stuck if is_fixed else loose)[key]
        copies = [Copy(touch, *marks) for touch, marks in bits.items() if touch in wanted]
        # a geom that can touch nothing is still there for rays
        result.append(copies or [Copy(Touch(key.friction, key.restitution), 0, 0)])
    return result
