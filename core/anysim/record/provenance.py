"""Which versions were involved."""

import re
from importlib import metadata

_NAME = re.compile(r"[A-Za-z0-9._-]+")


def package_versions() -> dict[str, str]:
    """Versions of the installed `anysim` distributions and of what they require directly, sorted by name.

    Extras are left out; what is not installed is not listed.
    """
    ours = {dist.name: dist for dist in metadata.distributions() if _normal(dist.name or "").startswith("anysim")}
    names = {_normal(name) for name in ours}
    for dist in ours.values():
        for requirement in dist.requires or []:
            found = _NAME.match(requirement)
            if found is not None and "extra ==" not in requirement:
                names.add(_normal(found[0]))
    versions: dict[str, str] = {}
    for name in sorted(names):
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return versions


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()
