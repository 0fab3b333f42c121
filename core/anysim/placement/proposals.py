"""Proposals: poses by logical identity, from a language or vision model, a program or a person.

A proposal is JSON: `{"poses": {"mug": {"position": [0.5, 0.1, 0.42], "yaw": 0.3}}, "reason": "…"}`, or a list of such,
of which each episode draws one. A proposer gets a `Request`. What comes back is data and nothing is believed:
names, numbers, regions and collisions are checked, and a pose is moved no farther than the bounds of the spec allow.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from math import hypot
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from anysim.errors import SpecError, SpecIssue, listing, suggest
from anysim_schemas.files import read_plain
from anysim_schemas.limits import JSON_BYTES
from anysim_schemas.proposals import Proposal, Proposals


@dataclass(frozen=True)
class Thing:
    """Something that can be placed.

    `size` [m] is that of the box around it, unturned; `bottom` how far its lowest point is below its origin. `layout`
    is what the spec says of its place.
    """

    name: str
    category: str
    label: str
    size: tuple[float, float, float]
    bottom: float
    layout: Mapping[str, Any]


@dataclass(frozen=True)
class LevelSurface:
    """A level surface: `outline` are its corners x, y [m] where its owner is nominally, `free` the boxes that are not.

    `taken` are rectangles (x0, y0, x1, y1) of what stands there already and stays.
    """

    name: str
    height: float
    headroom: float
    outline: Sequence[tuple[float, float]]
    taken: Sequence[tuple[float, float, float, float]] = ()


@dataclass(frozen=True)
class Request:
    """What a proposer needs to know. `seed` is the episode's: a proposer that draws should draw from it."""

    scene: str
    seed: int
    things: Sequence[Thing]
    supports: Sequence[LevelSurface]
    robots: Mapping[str, Sequence[float]] = field(default_factory=dict)

    def to_json(self) -> str:
        """As text, for a model that reads text."""
        return json.dumps(asdict(self), indent=1, allow_nan=True)


Proposer = Callable[[Request], Any]
"""Gives a `Proposal`, or data of that form: a mapping, or JSON text."""


def read_file(path: Path, where: str) -> tuple[Proposal, ...]:
    """The proposals of a JSON file.

    Raises:
        SpecError: it is missing, no JSON, or of another form; with the path of the key in the spec.
    """
    try:
        text = read_plain(path, JSON_BYTES).decode()
    except UnicodeDecodeError as error:
        raise SpecError([SpecIssue("", where, f"the proposal {path} is not UTF-8 text")]) from error
    except OSError as error:
        raise SpecError([SpecIssue("", where, f"cannot read the proposal {path}: {error.strerror}")]) from error
    return parsed(text, str(path), where)


def parsed(data: Any, source: str, where: str) -> tuple[Proposal, ...]:
    """Proposals from JSON text, a mapping, a list, or what is one already.

    Raises:
        SpecError: a sentence for each fault; `source` says whose proposal it is.
    """
    if isinstance(data, Proposal):
        return (data,)
    if isinstance(data, str):
        try:
            data = json.loads(data)
        except (ValueError, RecursionError) as error:
            raise SpecError([SpecIssue(source, where, f"the proposal is no JSON: {error}")]) from error
    if isinstance(data, list):
        data = {"proposals": data}
    several = isinstance(data, dict) and "proposals" in data
    try:
        found = Proposals.model_validate(data).proposals if several else (Proposal.model_validate(data),)
    except ValidationError as error:
        issues = [
            SpecIssue(source, where, f"the proposal at {'.'.join(map(str, e['loc'])) or 'its root'}: {e['msg']}")
            for e in error.errors(include_url=False)
        ]
        raise SpecError(issues) from error
    return found


def faults(proposal: Proposal, known: Sequence[str]) -> dict[str, str]:
    """What is wrong with a proposal before geometry: a sentence for each object."""
    found: dict[str, str] = {}
    for name, pose in proposal.poses.items():
        if name not in known:
            found[name] = f"there is no object '{name}' to place{suggest(name, known)} (objects: {listing(known)})"
        elif pose.quaternion is not None and abs(hypot(*pose.quaternion) - 1.0) > 1e-3:
            found[name] = f"'{name}': its quaternion has the length {hypot(*pose.quaternion):.4g}, not 1"
        elif pose.quaternion is not None and pose.yaw:
            found[name] = f"'{name}': give either a quaternion or yaw"
    return found
