"""Rewrite a package's generic functions and classes (`def f[T](…)`) so that Python 3.11 reads them: the names go.

For packages of an environment of its own that ask for Python 3.12 and need nothing else of it. Annotations that use the
names stay words, since `from __future__ import annotations` is needed and looked for.
"""

import re
import sys
from importlib.util import find_spec
from pathlib import Path

GENERIC = re.compile(r"^(\s*(?:async )?def \w+|class \w+)\[[^\]]*\](?=[(:])", re.MULTILINE)


def rewrite(folder: Path) -> list[str]:
    """Rewrite the files below a folder; returns the names of those that were changed."""
    changed = []
    for file in sorted(folder.rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        older = GENERIC.sub(r"\1", text)
        if older != text:
            if "from __future__ import annotations" not in text:
                sys.exit(f"{file}: its annotations are evaluated; it needs Python 3.12")
            file.write_text(older, encoding="utf-8")
            changed.append(file.name)
    return changed


if __name__ == "__main__":
    place = find_spec(sys.argv[1])
    if place is None or not place.submodule_search_locations:
        sys.exit(f"there is no package {sys.argv[1]} in this environment")
    if sys.version_info < (3, 12):
        print(f"{sys.argv[1]}: rewritten for Python 3.11:", *rewrite(Path(place.submodule_search_locations[0])))
