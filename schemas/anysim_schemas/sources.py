"""Reads files with what they extend."""

import difflib
import os
import re
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

from anysim_schemas.errors import AnysimError
from anysim_schemas.files import RefusedFileError, exists, project_root, read_plain
from anysim_schemas.limits import YAML_BYTES, YAML_FILES
from anysim_schemas.merging import merge
from anysim_schemas.messages import describe
from anysim_schemas.nodes import Fault, Mark, Node, from_data
from anysim_schemas.shapes import Shapes
from anysim_schemas.yaml import parse

Source = str | Path | Mapping[str, Any]
"""A YAML file by its path, or the data itself."""

ExtendsResolver = Callable[[str], Path]
"""Turns `scheme:name` after `extends:` into the path of a file; raises an AnysimError, LookupError or OSError."""

_URI = re.compile(r"[a-zA-Z][a-zA-Z0-9+.-]+:")


class Reader:
    """Reads sources, follows `extends`, and remembers what it read and what went wrong.

    A file may extend files below its root (`project_root`), which is that of the file that was asked for first; a
    file that is looked up by `scheme:name` has its own.

    Attributes:
        files: every file read, what is extended before what extends it.
        names: the same files as errors show them.
        faults: what is wrong with single values; reading went on.
        fatal: what keeps a file from being read.
    """

    def __init__(self, shapes: Shapes, extends: ExtendsResolver | None) -> None:
        self._shapes = shapes
        self._extends = extends
        self._done: dict[Path, Node | None] = {}
        self._chain: list[tuple[Path, str]] = []
        self._asked = 0
        self.files: list[Path] = []
        self.names: list[str] = []
        self.faults: list[Fault] = []
        self.fatal: list[Fault] = []

    def read(self, source: Source) -> Node | None:
        """The data of a source with everything it extends beneath; None where it cannot be read."""
        if isinstance(source, Mapping):
            return self._with_bases(from_data(source), Path(), project_root(Path()))
        return self._read_file(Path(source), shown=_relative(Path(source)), asked=None, root=None)

    def merged(self, nodes: Sequence[Node | None]) -> Node:
        """Several sources as one, the later on top."""
        merged = Node({}, Mark("", 0, 0))
        for node in nodes:
            merged = merged if node is None else merge(merged, node, self._shapes)
        return merged

    def _read_file(self, path: Path, shown: str, asked: Fault | None, root: Path | None) -> Node | None:
        """A file by its path; `asked` is the place that extends it, `root` the folder it must lie in."""
        try:
            resolved = path.resolve()
            root = root or project_root(path.parent)
        except (OSError, RuntimeError, ValueError):  # a circle of links, a name that is too long or has a NUL
            place, where, _ = asked or Fault(Mark(shown, 0, 0), "", "")
            self.fatal.append(Fault(place, where, f"{shown!r} cannot be the name of a file"))
            return None
        if asked is not None and not resolved.is_relative_to(root):
            remedy = "move it there, or mark the folder of both with a pyproject.toml or package.xml"
            message = f"the file '{shown}' that it extends lies outside of {root}, the root of this file; {remedy}"
            self.fatal.append(asked._replace(message=message))
            return None
        if any(resolved == open_path for open_path, _ in self._chain):
            chain = [name for _, name in self._chain]
            start = [open_path for open_path, _ in self._chain].index(resolved)
            place, where, _ = asked or Fault(Mark(shown, 1, 1), "", "")
            self.fatal.append(Fault(place, where, f"the file extends itself: {' → '.join([*chain[start:], shown])}"))
            return None
        if resolved not in self._done:
            self._chain.append((resolved, shown))
            self._done[resolved] = self._read_new(path, shown, asked, root)
            self._chain.pop()
            self.files.append(path)
            self.names.append(shown)
        return self._done[resolved]

    def _read_new(self, path: Path, shown: str, asked: Fault | None, root: Path) -> Node | None:
        try:
            text = read_plain(path, YAML_BYTES).decode("utf-8-sig")
        except (OSError, UnicodeDecodeError) as error:
            place, where, _ = asked or Fault(Mark(shown, 0, 0), "", "")
            subject = "it" if asked is None else f"the file '{shown}' that it extends"
            self.fatal.append(Fault(place, where, f"{subject} {_read_problem(error, path)}"))
            return None
        node, problems = _parsed(text, shown)
        (self.faults if node is not None else self.fatal).extend(problems)
        if node is None:
            return None
        if node.value is None:
            node = Node({}, node.mark)
        if not isinstance(node.value, dict):
            # not which value: the file may be no spec at all, and its text is not to be shown
            found = describe(node.plain()) if isinstance(node.value, list) else "a single value"
            self.fatal.append(Fault(node.mark, "", f"a spec is a mapping of keys at its top, got {found}"))
            return None
        return self._with_bases(node, path.parent, root)

    def _with_bases(self, node: Node, folder: Path, root: Path) -> Node:
        """The root without its private keys, on top of the files it extends."""
        entries = cast("dict[str, Node]", node.value)
        own = Node({k: v for k, v in entries.items() if k != "extends" and not k.startswith("_")}, node.mark)
        if "extends" not in entries or entries["extends"].value is None:
            return own
        asked = entries["extends"]
        items = asked.value if isinstance(asked.value, list) else [asked]
        bases = [
            self._base(item, folder, root, f"extends.{i}" if len(items) > 1 else "extends")
            for i, item in enumerate(items)
        ]
        return self.merged([*bases, own])

    def _base(self, item: Node, folder: Path, root: Path, where: str) -> Node | None:
        self._asked += 1
        if YAML_FILES.exceeded(self._asked):
            if YAML_FILES.value + 1 == self._asked:
                self.fatal.append(Fault(item.place, where, f"this run {YAML_FILES.sentence(self._asked)}"))
            return None
        if not isinstance(item.value, str) or not item.value:
            message = f"expected the name of a file or a list of names, got {describe(item.plain())}"
            self.fatal.append(Fault(item.place, where, message))
            return None
        asked = Fault(item.place, where, "")
        if not _URI.match(item.value):
            path = folder / item.value
            if not exists(path) and self._names_a_task(item.value):
                message = f"there is no file '{_relative(path)}'; did you mean 'task:{item.value}'?"
                self.fatal.append(asked._replace(message=message))
                return None
            return self._read_file(path, _relative(path), asked, root)
        if self._extends is None:
            message = f"'{item.value}' is not a path, and nothing here can look it up; give the path of a file"
            self.fatal.append(asked._replace(message=message))
            return None
        try:
            path = self._extends(item.value)
        except (AnysimError, LookupError, OSError) as error:
            detail = error.args[0] if isinstance(error, KeyError) and error.args else error
            self.fatal.append(asked._replace(message=f"'{item.value}' cannot be looked up: {detail}"))
            return None
        return self._read_file(path, _relative(path), asked, project_root(path.parent))

    def _names_a_task(self, name: str) -> bool:
        """Whether what is extended as a file is the name of an installed task."""
        try:
            return self._extends is not None and bool(self._extends(f"task:{name}"))
        except (AnysimError, LookupError, OSError):
            return False


@lru_cache(maxsize=32)
def _parsed(text: str, shown: str) -> tuple[Node | None, tuple[Fault, ...]]:
    """The data of a text, and what is wrong with it. Kept: a task is read several times on its way to an env."""
    problems: list[Fault] = []
    return parse(text, shown, problems), tuple(problems)


def _relative(path: Path) -> str:
    """The path as errors show it: as given, without detours, from the current directory where it lies below it."""
    shown = os.path.normpath(path)
    here = Path.cwd()
    return str(Path(shown).relative_to(here)) if Path(shown).is_relative_to(here) else shown


def _read_problem(error: OSError | UnicodeDecodeError, path: Path) -> str:
    if isinstance(error, UnicodeDecodeError):
        return f"is not UTF-8 text: byte {error.start} is 0x{error.object[error.start]:02x}"
    if isinstance(error, FileNotFoundError):
        names = sorted(p.name for p in path.parent.glob("*.y*ml")) if path.parent.is_dir() else []
        near = difflib.get_close_matches(path.name, names, n=1)
        return f"does not exist; did you mean '{near[0]}'?" if near else "does not exist"
    return str(error.strerror) if isinstance(error, RefusedFileError) else f"cannot be read: {error.strerror}"
