"""The checks of `make check` that no ready-made tool makes: `python scripts/check_style.py [ROOT]`.

Prints one line a fault, with the place and the remedy, and exits with 1 if there is any.
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from checks import constraints, house, junk, length, links, packages, participles, words, yaml_header
from checks.tree import Fault, Tree

CHECKS: Sequence[Callable[[Tree], Iterator[Fault]]] = (
    house.check,
    length.check,
    words.check,
    participles.check,
    junk.check,
    packages.check,
    constraints.check,
    yaml_header.check,
    links.check,
)


def faults(root: Path) -> list[Fault]:
    """All faults of the repository, sorted by place."""
    tree = Tree.of(root)
    return sorted(fault for check in CHECKS for fault in check(tree))


def main(root: Path) -> int:
    """Print the faults and return the exit code."""
    found = faults(root)
    for fault in found:
        print(fault)
    fatal = sum(fault.fatal for fault in found)
    print(f"style: {fatal} faults, {len(found) - fatal} warnings in {len(Tree.of(root).files)} files")
    return 1 if fatal else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parents[1])))
