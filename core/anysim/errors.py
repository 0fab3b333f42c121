"""The error family: every message says what, where, what was expected, what exists, and the remedy."""

import difflib
from collections.abc import Iterable, Sequence

from anysim_schemas.errors import AnysimError, SpecError, SpecIssue

__all__ = [
    "AnysimError", "AssetError", "CapabilityError", "EngineError", "NameLookupError", "PluginError", "RecordError",
    "SnapshotError", "SpecError", "SpecIssue", "StaleStateError", "TaskError", "listing", "suggest",
]  # fmt: skip


class PluginError(AnysimError):
    """A plugin that is unknown, ambiguous, or does not load."""


class AssetError(AnysimError):
    """An asset that is missing, leaves its root, or holds something the neutral model cannot say.

    `issues` holds one entry for each asset where a whole spec was compiled; their paths are the keys that ask for it.
    """

    def __init__(self, message: str = "", issues: Sequence[SpecIssue] = ()) -> None:
        self.issues = tuple(issues)
        super().__init__(message or "\n".join(str(issue) for issue in self.issues))


class CapabilityError(AnysimError):
    """A world needs what an engine does not have. Lists every mismatch."""


class EngineError(AnysimError):
    """An engine was misused, or failed."""


class StaleStateError(EngineError):
    """A `State` was read after the engine moved on."""


class NameLookupError(AnysimError, LookupError):
    """A name that does not exist in the world."""


class SnapshotError(AnysimError):
    """A snapshot that does not belong to this world, engine or version."""


class TaskError(AnysimError):
    """A task that is misused or inconsistent."""


class RecordError(AnysimError):
    """A record that is incomplete, damaged or of another format."""


def listing(names: Iterable[str], limit: int = 12) -> str:
    """The names in reading order, cut after `limit`: `a, b, c and 4 more`; `none` where there are none."""
    items = list(names)
    if not items:
        return "none"
    tail = f" and {len(items) - limit} more" if len(items) > limit else ""
    return ", ".join(items[:limit]) + tail


def suggest(name: str, names: Sequence[str]) -> str:
    """`; did you mean 'x'?` for the nearest existing name, else an empty string."""
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    return f"; did you mean '{near[0]}'?" if near else ""
