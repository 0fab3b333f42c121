"""Ways through rooms that were measured, kept in a file as they come, and what they come to."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from anysim.errors import AnysimError
from anysim.math.statistics import wilson
from anysim.record.commit import write_whole
from anysim_navigation_bench.drives import BASES, Drive, Driving

PLACES = {"seconds": 2, "length": 2, "hardest": 1, "tick": 3}
"""Decimals of fields of a drive that are kept."""


class Cell(NamedTuple):
    """One base on one engine among so many people, who walk at so much of their usual pace."""

    robot: str
    engine: str
    people: int
    pace: float = 1.0


class DriveStore:
    """Drives by cell, each a line of a JSON file, if there is one; what is in it is not driven again."""

    def __init__(self, path: Path | None) -> None:
        self.path = path
        self.drives: dict[Cell, list[Drive]] = {}
        if path is None or not path.exists():
            return
        try:
            for line in json.loads(path.read_text("utf-8")):
                cell = Cell(line["robot"], line["engine"], line["people"], line.get("pace", 1.0))
                self.drives[cell] = [Drive(*row) for row in line["drives"]]
        except (ValueError, TypeError, KeyError) as error:
            raise AnysimError(
                f"{path} is not a file of `anysim bench navigate --out` ({type(error).__name__}: {error}); "
                "name another one, or remove it"
            ) from error

    def known(self, cell: Cell) -> list[Drive]:
        """What was driven of a cell, by seed."""
        return sorted(self.drives.get(cell, []))

    def add(self, cell: Cell, one: Drive) -> None:
        """Keep a drive, in the file too."""
        kept = one._replace(**{key: round(getattr(one, key), places) for key, places in PLACES.items()})
        self.drives.setdefault(cell, []).append(kept)
        if self.path is None:
            return
        lines = [
            json.dumps({**found._asdict(), "drives": sorted(drives)}) for found, drives in sorted(self.drives.items())
        ]
        write_whole(self.path.parent, {self.path.name: "[\n" + ",\n".join(lines) + "\n]\n"})


def figures(cell: Cell, drives: list[Drive]) -> dict[str, Any]:
    """What the drives of a cell come to, as plain data."""
    solved = [one for one in drives if one.ended == "success"]
    pace = BASES.get(cell.robot, Driving()).skill.get("speed", 0.6)
    met = [one.met for one in drives if one.met]
    return {
        **cell._asdict(),
        "rooms": len(drives),
        "solved": len(solved),
        "interval": [round(share, 3) for share in wilson(len(solved), len(drives))],
        "failed": {str(one.seed): one.ended for one in drives if one.ended != "success"},
        "hardest_contact_n": max((one.hardest for one in solved), default=0.0),
        "time_over_shortest": _median([one.seconds / (one.length / pace) for one in solved]),
        "action_ms": _median([one.tick for one in drives]),
        "met": {word: met.count(word) for word in dict.fromkeys(met)},
    }


def rows(store: DriveStore) -> Iterator[dict[str, Any]]:
    """The figures of all cells."""
    for cell in sorted(store.drives):
        yield figures(cell, store.known(cell))


def _median(values: list[float]) -> float:
    return round(float(np.median(values)), 3) if values else float("nan")
