"""The ways of bases through furnished rooms in docs/navigation.md, from docs/navigation.json.

    python scripts/navigation_table.py [--check]

The file is made by this command, which goes on where it was cut off, a base and an engine at a time or all at once:

    anysim bench navigate --robots unitree_go1 --engines mujoco,sapien --rooms 100 --out docs/navigation.json
    anysim bench navigate --robots holonomic_base --people 4 --rooms 50 --out docs/navigation.json

`--check` writes nothing and exits with 1 if the page has drifted from the file.
"""

import sys
from typing import Any

from benchmark_table import table
from generated import ROOT, main

from anysim_navigation_bench.drive_store import DriveStore, rows
from anysim_navigation_bench.drives import BASES, MET, PACES

STORE = ROOT / "docs" / "navigation.json"
WORDS = {
    "contact": "hard contact",
    "person": "hit by a person",
    "controller": "held up",
    "no_path": "no way found",
    "truncated": "late",
}
"""What ended a drive, in words for the page."""


def failed(one: dict[str, Any]) -> str:
    """What ended the drives that failed, and the rooms."""
    by_word: dict[str, list[str]] = {}
    for seed, word in one["failed"].items():
        by_word.setdefault(WORDS[word] if word in WORDS else str(word), []).append(seed)
    return "; ".join(f"{word}: {', '.join(seeds)}" for word, seeds in by_word.items())


def line(one: dict[str, Any]) -> list[str]:
    """A row of the table."""
    low, high = one["interval"]
    return [
        f"`{one['robot']}`",
        one["engine"],
        f"{one['solved']} of {one['rooms']} ({100 * low:.0f} to {100 * high:.0f} %)",
        failed(one),
        f"{one['hardest_contact_n']:.0f} N",
        f"{one['time_over_shortest']:.1f}" if one["solved"] else "",
        f"{one['action_ms']:.1f} ms",
        *([", ".join(f"{one['met'][w]} {w}" for w in MET[1:] if w in one["met"])] if one["people"] else []),
    ]


def rooms() -> str:
    """Static rooms first, then those with people, the quickest first."""
    found = sorted(rows(DriveStore(STORE)), key=lambda one: [*BASES, one["robot"]].index(one["robot"]))
    head = ["base", "engine", "arrived", "what failed, in rooms", "hardest contact", "time", "action"]
    parts = [table(head, [line(one) for one in found if not one["people"]])]
    for people, pace in sorted({(one["people"], -one["pace"]) for one in found if one["people"]}):
        low, high = (-pace * v for v in PACES)
        parts += [
            f"With {people} people who walk through the room at {low:g} to {high:g} m/s and yield to nothing; "
            "*met* counts drives on which one touched the base, which stood, was moving away or aside, or moved "
            "towards them:",
            table([*head, "met"], [line(one) for one in found if (one["people"], -one["pace"]) == (people, pace)]),
        ]
    return "\n\n".join(parts)


if __name__ == "__main__":
    sys.exit(main(__doc__, "rooms", "navigation_table.py", ("docs/navigation.md",), rooms))
