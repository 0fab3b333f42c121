"""The error family: every message says what, where, what was expected, what exists, and the remedy.

`Issues` collects what is wrong with a spec, so that all of it is said at once.
"""

import difflib
from collections.abc import Iterable, Sequence

from anysim_schemas.errors import AnysimError, SpecError, SpecIssue

__all__ = [
    "FAILURES",
    "AnysimError",
    "AssetError",
    "CapabilityError",
    "EngineError",
    "EngineFailure",
    "Issues",
    "NameLookupError",
    "PluginError",
    "PluginFailure",
    "RecordError",
    "SnapshotError",
    "SpecError",
    "SpecIssue",
    "StaleStateError",
    "TaskError",
    "listing",
    "suggest",
]


class PluginError(AnysimError):
    """A plugin that is unknown, ambiguous, or does not load."""


class PluginFailure(PluginError):
    """The code of a plugin that raised what it must not. Names the plugin, its distribution and the remedy."""


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


class CannotDraw(EngineError):
    """This machine lacks what an engine needs to draw: a driver, a library. Whatever else fails is another error."""


class EngineFailure(EngineError):
    """An engine that broke down: its process ended, or its library raised what it must not."""


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


FAILURES = (EngineFailure, PluginFailure)
"""Errors that no input explains: something broke."""


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


class Issues:
    """Faults found so far. `at(...)` gives a view whose paths start deeper; all views share one list."""

    def __init__(
        self,
        prefix: str = "",
        where: str = "",
        spec: list[SpecIssue] | None = None,
        assets: list[SpecIssue] | None = None,
    ) -> None:
        self._prefix, self._where = prefix, where
        self._spec: list[SpecIssue] = [] if spec is None else spec
        self._assets: list[SpecIssue] = [] if assets is None else assets

    def at(self, *parts: str | int) -> "Issues":
        """The same list, at a deeper path."""
        return Issues(self._join(*parts), self._where, self._spec, self._assets)

    def inside(self, where: str) -> "Issues":
        """The same list, for another file; paths start anew."""
        return Issues("", where, self._spec, self._assets)

    def add(self, path: str, message: str) -> None:
        """A fault at `path` below this view's path."""
        _note(self._spec, SpecIssue(self._where, self._join(path) if path else self._prefix, message))

    def asset(self, path: str, error: AssetError) -> None:
        """An asset that `path` asks for and that cannot be had."""
        _note(self._assets, SpecIssue(self._where, self._join(path), str(error)))

    def raise_if_any(self) -> None:
        """Raises SpecError with all faults; AssetError where nothing but assets are at fault."""
        if self._spec:
            raise SpecError([*self._spec, *self._assets])
        if self._assets:
            raise AssetError(issues=self._assets)

    def _join(self, *parts: str | int) -> str:
        return ".".join(str(part) for part in (self._prefix, *parts) if part != "")


def _note(found: list[SpecIssue], issue: SpecIssue) -> None:
    """Once: what can be several things is compiled several times, and has its faults in all of them."""
    if issue not in found:
        found.append(issue)
