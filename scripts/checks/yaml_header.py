"""Editors complete a YAML file from its schema, if its first comment names one."""

import re
from collections.abc import Iterator

from checks.tree import Fault, Tree

HEADER = re.compile(r"#\s*yaml-language-server:\s*\$schema=(\S+)")


def check(tree: Tree) -> Iterator[Fault]:
    """YAML files of tasks, plugins and docs whose first line names no schema, or one that does not exist."""
    for path in tree.under("tasks", "plugins", "docs", suffixes=(".yaml", ".yml")):
        first = (tree.text(path) or "").partition("\n")[0]
        found = HEADER.match(first)
        if not found:
            yield Fault(path, 1, "its first line must name its schema: # yaml-language-server: $schema=PATH")
        elif "://" not in found[1] and not (tree.root / path.parent / found[1]).is_file():
            yield Fault(path, 1, f"the schema {found[1]} does not exist; the path is relative to the YAML file")
