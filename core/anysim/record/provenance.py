"""Versions of what takes part in a run."""

import re
from importlib import metadata

from anysim import registry

_NAME = re.compile(r"[A-Za-z0-9._-]+")


def package_versions() -> dict[str, str]:
    """Versions of the distributions that offer something to anysim and of what they require directly, sorted by name.

    Extras are left out; what is not installed is not listed.
    """
    known = {_normal(name): dist for name, dist in registry.participants().items()}
    names = set(known)
    for dist in [*known.values(), _installed("anysim-schemas")]:
        for requirement in (dist.requires if dist else None) or []:
            found = _NAME.match(requirement)
            if found is not None and "extra ==" not in requirement:
                names.add(_normal(found[0]))
    present = {name: known.get(name) or _installed(name) for name in sorted(names)}
    return {name: dist.version for name, dist in present.items() if dist is not None}


def _installed(name: str) -> metadata.Distribution | None:
    try:
        return metadata.distribution(name)
    except metadata.PackageNotFoundError:
        return None


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()
