"""Collecting the faults of a spec, so that one error names them all."""

from anysim.errors import AssetError, SpecError, SpecIssue


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
