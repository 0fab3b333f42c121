"""Links and make targets in the documents: they exist."""

import re
from collections.abc import Iterator
from pathlib import Path

from checks.tree import Fault, Tree

LINK = re.compile(r"\]\(<?([^)\s#>]+)[^)]*\)")
MAKE = re.compile(r"(?:[`$]\s*make ([a-z][a-z-]*)|^make ([a-z][a-z-]*)(?=\s*$|\s+#|\s+[A-Z_]+=))")
TARGET = re.compile(r"^([a-z][a-z-]*):(?!=)", re.MULTILINE)


def check(tree: Tree) -> Iterator[Fault]:
    """Relative links of Markdown files that lead nowhere, and make targets that the Makefile does not have."""
    makefile = tree.root / "Makefile"
    targets = sorted(TARGET.findall(makefile.read_text("utf-8"))) if makefile.is_file() else []
    for path in tree.under(suffixes=(".md",)):
        for number, line in enumerate((tree.text(path) or "").splitlines(), 1):
            for link in LINK.findall(line):
                if not re.match(r"[a-z][a-z+.-]*:", link) and not _resolve(tree.root, path, link).exists():
                    yield Fault(path, number, f"the link {link} leads nowhere; links are relative to the file")
            for target in (quoted or alone for quoted, alone in MAKE.findall(line)):
                if target not in targets:
                    yield Fault(path, number, f"there is no `make {target}` (targets: {', '.join(targets)})")


def _resolve(root: Path, path: Path, link: str) -> Path:
    return root / link.lstrip("/") if link.startswith("/") else root / path.parent / link
