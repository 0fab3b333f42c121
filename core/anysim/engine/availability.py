"""Which versions of a library an engine may run on. By installed metadata alone: nothing heavy is imported."""

import re
from collections.abc import Mapping

from anysim.engine.state import Availability

Version = tuple[int, ...]


def judge(
    package: str, version: str, minimum: Version, lacks: str, wrong: Mapping[Version, str], remedy: str
) -> Availability:
    """Whether the installed `version` (empty: none) of `package` will do.

    Args:
        package: the distribution, as messages call it.
        version: as `importlib.metadata.version` gives it.
        minimum: the oldest that will do.
        lacks: what older ones are missing, as in `has no mujoco.batch`.
        wrong: versions whose results cannot be trusted, and why.
        remedy: the command that installs a good one.
    """
    if not version:
        return Availability(False, "", (f"the package {package} is not installed",), remedy)
    numbers = _numbers(version)
    if numbers < _numbers(".".join(map(str, minimum))):
        oldest = ".".join(map(str, minimum))
        return Availability(False, version, (f"{package} {version} {lacks}: it is older than {oldest}",), remedy)
    why = wrong.get(numbers)
    if why is not None:
        return Availability(False, version, (f"{package} {version} is unusable: {why}",), remedy)
    return Availability(True, version)


def _numbers(version: str) -> Version:
    """The release as three numbers: 4.0, 4.0.0 and 4.0.0rc1 are one."""
    release = re.match(r"\d+(?:\.\d+)*", version)
    numbers = [int(n) for n in release[0].split(".")[:3]] if release else []
    return tuple([*numbers, 0, 0, 0][:3])
