"""Questions about where things are: on what, on which side, next to what, and which is the furthest or the tallest."""

from collections.abc import Iterator
from itertools import combinations

from anysim_language.questions.question import Asker, Question
from anysim_language.relations import direction

SIDES = {"left": "to the left of", "right": "to the right of", "behind": "behind", "before": "in front of"}
CLEAR = 15
"""What is on a side, nearest, tallest and so on is so by at least this much [mm]."""


def about_places(asker: Asker) -> Iterator[Question]:
    """All of them for one moment."""
    yield from _support(asker)
    yield from _spatial(asker)
    yield from _nearest(asker)
    yield from _superlative(asker)


def _support(asker: Asker) -> Iterator[Question]:
    the = asker.naming.the
    for thing in asker.objects:
        held = asker.held(thing.name)
        if held is None:
            continue
        owner = held.where.partition(".")[0]
        refers = [name for name in (thing.name, owner) if name != "ground"]
        program = {"thing": thing.name, "relation": held.relation, "where": held.where}
        where = asker.place(held.where)
        yield asker.ask("support", where, program, refers, thing=the(thing.name), relation=held.relation)
        others = [t.name for t in asker.objects if t.name not in (thing.name, owner)]
        for other, answer in ((owner, "yes"), *((name, "no") for name in others[:1])):
            if other == "ground":
                continue
            place = asker.place(held.where if other == owner else other)
            yield asker.ask(
                "supported",
                answer,
                {**program, "where": held.where if other == owner else other},
                (thing.name, other),
                thing=the(thing.name),
                relation=held.relation,
                where=place,
            )


def _spatial(asker: Asker) -> Iterator[Question]:
    if not asker.moment.viewer.name:
        return
    viewer = asker.naming.the(asker.moment.viewer.name)
    for a, b in combinations(asker.objects, 2):
        on_a, on_b = asker.held(a.name), asker.held(b.name)
        if on_a is None or on_b is None or (on_a.relation, on_a.where) != (on_b.relation, on_b.where):
            continue
        side, slack = direction(asker.moment, a.name, b.name)
        if slack < CLEAR:
            continue
        others = [other for other in SIDES if other != side]
        wrong = others[(len(a.name) + len(b.name) + asker.step) % len(others)]
        for asked in (side, wrong):
            yield asker.ask(
                "spatial",
                "yes" if asked == side else "no",
                {"a": a.name, "b": b.name, "side": asked},
                (a.name, b.name),
                viewer=viewer,
                a=asker.naming.the(a.name),
                b=asker.naming.the(b.name),
                side=SIDES[asked],
            )


def _nearest(asker: Asker) -> Iterator[Question]:
    at = asker.moment.at
    for thing in asker.objects:
        others = [name for name in asker.together(thing.name) if name != thing.name]
        held = asker.held(thing.name)
        if len(others) < 2 or held is None:
            continue
        far = {
            name: round(sum((a - b) ** 2 for a, b in zip(at(name), at(thing.name), strict=True)) ** 0.5)
            for name in others
        }
        first, second = sorted(others, key=lambda name: (far[name], name))[:2]
        if far[second] - far[first] >= CLEAR:
            yield asker.ask(
                "nearest",
                asker.naming.the(first),
                {"thing": thing.name, "relation": held.relation, "where": held.where, "answer": first},
                (thing.name, first),
                thing=asker.naming.the(thing.name),
                relation=held.relation,
                where=asker.place(held.where),
            )


def _superlative(asker: Asker) -> Iterator[Question]:
    seen: set[tuple[str, str]] = set()
    for thing in asker.objects:
        held = asker.held(thing.name)
        names = asker.together(thing.name)
        if held is None or len(names) < 2 or (held.relation, held.where) in seen:
            continue
        seen.add((held.relation, held.where))
        extent, viewer = asker.moment.extent, asker.moment.viewer
        measures = {
            "the tallest": {n: extent(n).high[2] - extent(n).low[2] for n in names},
            "the lowest": {n: extent(n).low[2] - extent(n).high[2] for n in names},
        }
        if viewer.name:
            seen_by = asker.naming.the(viewer.name)
            measures |= {
                f"the furthest to the left as {seen_by} sees it": {
                    n: viewer.lateral(asker.moment.at(n)) for n in names
                },
                f"the furthest from {seen_by} along its view": {n: viewer.ahead(asker.moment.at(n)) for n in names},
            }
        for kind, (most, measure) in zip(("tallest", "lowest", "left", "furthest"), measures.items(), strict=False):
            first, second = sorted(names, key=lambda name: (-measure[name], name))[:2]
            if measure[first] - measure[second] >= CLEAR:
                program = {"kind": kind, "relation": held.relation, "where": held.where, "answer": first}
                where = asker.place(held.where)
                yield asker.ask(
                    "superlative",
                    asker.naming.the(first),
                    program,
                    (first,),
                    relation=held.relation,
                    where=where,
                    most=most,
                )
