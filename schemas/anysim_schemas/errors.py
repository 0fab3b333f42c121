"""The error family of anysim, and the errors of a spec: one line for each fault, with file, line and column."""

from collections.abc import Sequence
from dataclasses import dataclass


class AnysimError(Exception):
    """Base of every error that anysim raises on purpose. The message says what, where, and the remedy."""


class KeyFault(ValueError):
    """Raised by a validator of a whole spec for a fault of one key, so that the error points there.

    Attributes:
        path: the keys from the spec that is validated to the one at fault.
    """

    def __init__(self, message: str, *path: str) -> None:
        super().__init__(message)
        self.path = path


@dataclass(frozen=True)
class SpecIssue:
    """One fault of a spec.

    Attributes:
        where: `pick.yaml:14:7`, or `-o physics.dt=0` for an override; empty for data without a file.
        path: the dotted path of the key, such as `objects.cube.masss`.
        message: what is wrong, what was expected, what exists.
    """

    where: str
    path: str
    message: str

    def __str__(self) -> str:
        parts = [part for part in (self.where, self.path, self.message) if part]
        return ": ".join(parts)


class SpecError(AnysimError):
    """A file or an override that cannot be understood. Holds every issue found, in the order of the file."""

    def __init__(self, issues: Sequence[SpecIssue]) -> None:
        self.issues = tuple(issues)
        super().__init__("\n".join(str(issue) for issue in self.issues))
