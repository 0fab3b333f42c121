"""The stored measurement of the catalogue: by robot what it is, and by engine what its qualification found."""

import json
from collections.abc import Callable, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

from anysim import registry
from anysim.assets.catalogue import CatalogueEntry, load_robot, missing_source
from anysim.cache import digest
from anysim.errors import AnysimError
from anysim_robots.qualify.apart import LIMIT, qualify_apart
from anysim_robots.qualify.result import Qualification, as_data, from_data
from anysim_robots.qualify.run import FULL, Durations

ESTIMATE = 20.0
"""[s] for one robot on one engine, before anything was measured."""

Stored = dict[str, Any]


def fingerprint(entry: CatalogueEntry) -> str:
    """Changes with the entry's YAML and with the version of the distribution that brings it."""
    try:
        version = metadata.version(registry.distribution("robots", entry.spec.name))
    except (AnysimError, metadata.PackageNotFoundError):
        version = ""
    return digest(entry.file.read_bytes(), version)[:16]


def package(entry: CatalogueEntry) -> str:
    """The optional package that brings the entry's files, as `NAME VERSION`; empty where it needs or finds none."""
    if not entry.spec.needs or missing_source(entry):
        return ""
    try:
        return f"{entry.spec.needs} {metadata.version(entry.spec.needs)}"
    except metadata.PackageNotFoundError:
        return entry.spec.needs


def read(path: Path) -> Stored:
    """What a file holds; nothing where there is none.

    Raises:
        AnysimError: it is no measurement.
    """
    if not path.is_file():
        return {"robots": {}}
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        stored["robots"].items()
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise AnysimError(f"{path} is no measurement of the catalogue ({error}); delete it and measure again") from None
    return stored


def write(path: Path, stored: Stored) -> None:
    """Sorted, so that a difference between two measurements is one between the robots."""
    path.parent.mkdir(parents=True, exist_ok=True)
    ordered = {**stored, "robots": {name: stored["robots"][name] for name in sorted(stored["robots"])}}
    path.write_text(json.dumps(ordered, indent=1) + "\n", encoding="utf-8")


def results(row: Mapping[str, Any]) -> dict[str, Qualification]:
    """What was found of a robot, by engine."""
    return {engine: from_data(data) for engine, data in row["engines"].items()}


def due(stored: Stored, robots: Sequence[str], engines: Sequence[str], durations: Durations) -> list[tuple[str, str]]:
    """What is missing or was measured of another entry, for another time, or with another version of its package.

    What was measured where a package is installed stays where it is not.
    """
    wanted: list[tuple[str, str]] = []
    for robot in robots:
        row = stored["robots"].get(robot, {})
        try:
            same = _same(row, load_robot(robot), durations)
        except AnysimError:
            same = False
        wanted += [(robot, engine) for engine in engines if not same or engine not in row.get("engines", {})]
    return wanted


def measure(
    path: Path,
    robots: Sequence[str],
    engines: Sequence[str],
    durations: Durations = FULL,
    *,
    pictures: Path | None = None,
    limit: float = LIMIT,
    again: bool = False,
    timed: bool = True,
    tell: Callable[[str], object] = lambda words: None,
) -> Stored:
    """Qualify what is not in the file yet, one robot on one engine at a time, and write the file after each.

    Args:
        path: the JSON file; what it holds of unchanged entries is kept.
        robots: of the catalogue.
        engines: installed ones.
        durations: of the checks.
        pictures: a folder for ROBOT-ENGINE.png; None for no pictures.
        limit: wall-clock time for one robot on one engine [s].
        again: measure everything anew.
        timed: keep how long each took, for the next estimate; a file under version control has no use for it.
        tell: called with a line after each.
    """
    stored = read(path)
    wanted = due({"robots": {}} if again else stored, robots, engines, durations)
    if pictures is not None:
        wanted += [p for p in _undrawn(pictures, robots, engines) if p not in wanted]
    for robot, engine in wanted:
        try:
            entry = load_robot(robot)
        except AnysimError as error:
            stored["robots"][robot] = {"digest": "", "unreadable": str(error), "engines": {}}
            write(path, stored)
            tell(f"{robot}: {error}")
            continue
        row = _row(stored, entry, durations)
        known = row["engines"].get(engine)
        picture = None if pictures is None else pictures / f"{robot}-{engine}.png"
        if picture is not None:
            picture.parent.mkdir(parents=True, exist_ok=True)
        done = qualify_apart(
            robot, engine, None if known is not None and not again else durations, picture=picture, limit=limit
        )
        if done.found is not None:
            row["engines"][engine] = as_data(done.found._replace(seconds=round(done.found.seconds) if timed else 0))
        if picture is not None:
            row.setdefault("undrawn", {})[engine] = done.undrawn
        write(path, stored)
        tell(_line(robot, engine, done.found, done.undrawn))
    return stored


def _undrawn(pictures: Path, robots: Sequence[str], engines: Sequence[str]) -> list[tuple[str, str]]:
    return [(r, e) for r in robots for e in engines if not (pictures / f"{r}-{e}.png").is_file()]


def _row(stored: Stored, entry: CatalogueEntry, durations: Durations) -> Stored:
    """The row of a robot; a new one where the entry is another than before."""
    spec = entry.spec
    row = stored["robots"].get(spec.name)
    if row is None or not _same(row, entry, durations):
        row = stored["robots"][spec.name] = {"engines": {}}
    facts: Stored = {
        "digest": fingerprint(entry), "durations": list(durations), "category": spec.category,
        "description": spec.description, "license": spec.license, "source": spec.source, "base": spec.base,
    }  # fmt: skip
    if package(entry):
        facts["package"] = package(entry)
    row.update(facts)
    return row


def _same(row: Mapping[str, Any], entry: CatalogueEntry, durations: Durations) -> bool:
    """Whether a row is of this entry and this time, and of the files that are here, where there are some."""
    return (
        row.get("digest") == fingerprint(entry)
        and row.get("durations") == list(durations)
        and package(entry) in ("", row.get("package"))
    )


def _line(robot: str, engine: str, found: Qualification | None, undrawn: str) -> str:
    if found is None:
        return f"{robot} on {engine}: {undrawn or 'drawn'}"
    failed = "; ".join(check.told for check in found.failed)
    return f"{robot} on {engine}: {found.status}{f': {failed or found.why}' if failed or found.why else ''}"


def estimate(stored: Stored, count: int) -> float:
    """[s] for so many more, by the mean of those that were measured."""
    rows = [data for row in stored["robots"].values() for data in row["engines"].values()]
    taken = [data["seconds"] for data in rows if data["seconds"] > 0]
    return count * (sum(taken) / len(taken) if taken else ESTIMATE)
