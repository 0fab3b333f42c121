"""Versions of a library that an engine can run on, judged by metadata alone, and findings about this machine."""

import platform
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cache
from importlib import metadata
from typing import NamedTuple

from anysim.engine.state import Availability

Version = tuple[int, ...]


class Health(StrEnum):
    """How a thing is."""

    OK = "ok"
    NOTE = "note"  # good to know, nothing to repair
    ABSENT = "absent"  # this engine does not have it, by design
    MISSING = "missing"  # not installed
    UNAVAILABLE = "unavailable"  # installed, but not for this machine, or a version that must not be used
    WRONG = "wrong"  # it runs and gives a wrong answer
    BROKEN = "broken"  # it does not run


class Finding(NamedTuple):
    """One line of a diagnosis: what was looked at, how it is, what was found, and the remedy where one is needed."""

    what: str
    state: Health
    found: str
    remedy: str = ""


@dataclass(frozen=True)
class LibraryRequirement:
    """A library that an engine is built on, and the versions of it that will do.

    Attributes:
        package: the distribution, as messages call it.
        minimum: the oldest version that will do.
        lacks: what older ones are missing, as in `has no mujoco.batch`.
        remedy: the command that installs a good one.
        wrong: versions whose results cannot be trusted, and why.
        machines: the kinds of machine that it has wheels for on Linux; empty where it can be built on any.
        also: other distributions that bring the same library, and the command that installs a good one of each. Of one
            version with `package` they are its parts; of another one they and it overwrite each other's files.
    """

    package: str
    minimum: Version
    lacks: str
    remedy: str
    wrong: Mapping[Version, str] = field(default_factory=dict[Version, str])
    machines: tuple[str, ...] = ()
    also: Mapping[str, str] = field(default_factory=dict[str, str])

    def availability(self) -> Availability:
        """Whether the installed version will do."""
        found = {name: version for name in (self.package, *self.also) if (version := installed_version(name))}
        if len(found) < 2:
            name, version = next(iter(found.items()), (self.package, ""))
            one = self if name == self.package else replace(self, package=name, remedy=self.also[name])
            return one.judge(version)
        remedy = f"pip uninstall -y {' '.join(found)}, then {' or '.join([self.remedy, *self.also.values()])}"
        if len(set(found.values())) == 1:
            return replace(self, remedy=remedy).judge(found[self.package])
        both = " and ".join(f"{name} {version}" for name, version in found.items())
        why = f"{both} are installed, and each has overwritten files of the other: keep one"
        return Availability(False, next(iter(found.values())), (why,), remedy)

    def judge(self, version: str) -> Availability:
        """Whether a version will do, as `importlib.metadata.version` gives it, or an empty string for none."""
        if not version:
            missing = f"the package {self.package} is not installed"
            if self.machines and sys.platform.startswith("linux") and platform.machine() not in self.machines:
                missing += f" and has no wheel for {platform.machine()}"
            return Availability(False, "", (missing,), self.remedy)
        numbers, oldest = _numbers(version), ".".join(map(str, self.minimum))
        if numbers < _numbers(oldest):
            missing = f"{self.package} {version} {self.lacks}: it is older than {oldest}"
            return Availability(False, version, (missing,), self.remedy)
        why = self.wrong.get(numbers)
        if why is not None:
            return Availability(False, version, (f"{self.package} {version} is unusable: {why}",), self.remedy)
        return Availability(True, version)

    def __str__(self) -> str:
        """The versions that are taken, in words."""
        refused = "; ".join(f"{'.'.join(map(str, numbers))}: {why}" for numbers, why in self.wrong.items())
        taken = f"{'.'.join(map(str, self.minimum))} or newer{', or as '.join(['', *self.also])}"
        return taken + (f"; refused: {refused}" if refused else "")


@cache
def installed_version(package: str) -> str:
    """The version of a distribution, or an empty string."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""


def _numbers(version: str) -> Version:
    """The release as three numbers: 4.0, 4.0.0 and 4.0.0rc1 are one."""
    release = re.match(r"\d+(?:\.\d+)*", version)
    numbers = [int(n) for n in release[0].split(".")[:3]] if release else []
    return tuple([*numbers, 0, 0, 0][:3])
