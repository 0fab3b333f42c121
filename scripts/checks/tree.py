"""The files of the repository and what a check reports about them."""

import subprocess
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple


class Fault(NamedTuple):
    """Something wrong at a line (1-based; 0 for the whole file), as a sentence that ends in the remedy."""

    path: Path
    line: int
    message: str
    fatal: bool = True

    def __str__(self) -> str:
        where = f"{self.path}:{self.line}" if self.line else str(self.path)
        return f"{where}: {'' if self.fatal else 'warning: '}{self.message}"


class Member(NamedTuple):
    """One distribution of the workspace. `folder` is relative to the root, `project` its `[project]` table."""

    folder: Path
    project: dict[str, Any]

    @property
    def package(self) -> str:
        """The import name."""
        return self.project["name"].replace("-", "_")


@dataclass(frozen=True)
class Tree:
    """The repository at `root`. `files` are relative paths: those that git tracks or would add."""

    root: Path
    files: tuple[Path, ...] = field(repr=False)

    @classmethod
    def of(cls, root: Path) -> "Tree":
        """The tree of a git repository; deleted files that are still in the index are left out."""
        command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        listed = subprocess.run(command, cwd=root, check=True, capture_output=True, text=True).stdout
        names = sorted({name for name in listed.split("\0") if name})
        return cls(root, tuple(Path(name) for name in names if (root / name).is_file()))

    def under(self, *folders: str, suffixes: tuple[str, ...] = ()) -> Iterator[Path]:
        """Files in any of the folders (all files without one) that end in one of the suffixes."""
        for path in self.files:
            if (not folders or path.parts[0] in folders) and (not suffixes or path.suffix in suffixes):
                yield path

    def text(self, path: Path) -> str | None:
        """The text of a file, or None if it is binary."""
        data = (self.root / path).read_bytes()
        if b"\0" in data[:8192]:
            return None
        return data.decode("utf-8", errors="replace")

    @cached_property
    def settings(self) -> dict[str, Any]:
        """The workspace's pyproject.toml."""
        return _toml(self.root / "pyproject.toml")

    @cached_property
    def members(self) -> tuple[Member, ...]:
        """The distributions of the workspace, in the order of its globs."""
        folders = [
            found.parent
            for pattern in self.settings["tool"]["uv"]["workspace"]["members"]
            for found in sorted(self.root.glob(f"{pattern}/pyproject.toml"))
        ]
        return tuple(Member(f.relative_to(self.root), _toml(f / "pyproject.toml")["project"]) for f in folders)


def _toml(path: Path) -> dict[str, Any]:
    return tomllib.loads(path.read_text("utf-8"))
