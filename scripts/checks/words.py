"""Words that no file may hold: they would tie the repository to one machine or one mirror, or say a person for a thing.

The patterns are written so that they do not match themselves.
"""

import re
from collections.abc import Iterator

from checks.tree import Fault, Tree

FORBIDDEN = (
    (
        r"(?<![\w.~$}>])/(ro[o]t|wor[k]|hom[e]/[a-z]\w*|User[s]/\w+)/|\b[A-Z]:[\\/]User[s][\\/]",
        "a path of one machine; use a path relative to the repository or to the user's folders",
    ),
    (
        r"\b(pyp[i]\.org|pythonhosted\.or[g]|npmj[s]\.(org|com)|anacond[a]\.(org|com)|deb\.debia[n]\.org"
        r"|debia[n]\.org/debian|archive\.ubunt[u]\.com|crate[s]\.io)\b",
        "the host of a package registry; name the package alone",
    ),
    (r"(?i)\bwhoeve[r]\b|\bwho is ther[e]\b|\bnobody'[s]\b", "not plain English here; name the person, or the thing"),
)


def check(tree: Tree) -> Iterator[Fault]:
    """Machine paths, registry hosts and words for persons, in any text file."""
    rules = [(re.compile(pattern), why) for pattern, why in FORBIDDEN]
    for path in tree.files:
        for number, line in enumerate((tree.text(path) or "").splitlines(), 1):
            for pattern, why in rules:
                if found := pattern.search(line):
                    yield Fault(path, number, f"'{found.group()}' is {why}")
