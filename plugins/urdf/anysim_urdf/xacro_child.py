"""A process of its own that expands one xacro file: a xacro is a program, which may read nothing but its folders.

It is run as a file, imports nothing of anysim, and speaks JSON: an order on the standard input, an answer on the
standard output. Whatever the file's expressions do, an audit hook refuses to open a file outside of the folders of the
order, to write one, to start a program or to connect to anything; memory and time are bounded.
"""

import json
import os
import resource
import sys
from pathlib import Path
from typing import Any

_FORBIDDEN = (
    "os.",
    "subprocess.",
    "socket.",
    "shutil.",
    "ctypes.",
    "urllib.",
    "http.",
    "ftplib.",
    "sqlite3.",
    "signal.",
    "pty.",
    "fcntl.",
    "mmap.",
    "tempfile.",
    "webbrowser.",
    "gc.",
    "sys._",
    "sys.set",
    "sys.add",
    "import",
)
_ALLOWED = ("os.listdir", "os.scandir", "sys._getframe")


class _MissingPackage(Exception):
    """A package whose folder is not known yet."""


class _RefusedByGuard(Exception):
    """Something that no model file needs."""


def _guard(roots: list[str]) -> None:
    folders = [os.path.realpath(root) for root in roots]

    def inside(path: Any) -> bool:
        real = os.path.realpath(os.fsdecode(path))
        return any(real == folder or real.startswith(folder + os.sep) for folder in folders)

    def hook(event: str, given: tuple[Any, ...]) -> None:
        if event == "open":
            path, mode, flags = given
            if isinstance(path, int):
                return
            if flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT) or (isinstance(mode, str) and set(mode) & set("wax+")):
                raise _RefusedByGuard(f"it would write {path!r}")
            if not inside(path):
                raise _RefusedByGuard(f"it refers to {path!r}, which leaves its folders {', '.join(folders)}")
        elif event in ("os.listdir", "os.scandir", "glob.glob"):
            place = given[0]
            if event != "glob.glob" and place is not None and not isinstance(place, int) and not inside(place):
                raise _RefusedByGuard(f"it looks into {place!r}, which leaves its folders")
        elif event.startswith(_FORBIDDEN) and event not in _ALLOWED:
            raise _RefusedByGuard(f"an expression of it would do what no model needs ({event} {str(given[:1])[:80]})")

    sys.addaudithook(hook)


def _expand(order: dict[str, Any]) -> str:
    # before the hook, after which nothing is imported
    import xml.dom.expatbuilder  # noqa: F401

    import xacro
    import yaml  # noqa: F401
    from xacro import substitution_args

    packages: dict[str, str] = order["packages"]
    limit: int = order["bytes"]
    total = [0]

    def find(name: str) -> str:
        if name not in packages:
            raise _MissingPackage(name)
        return packages[name]

    def read(source: Any, filename: str | None = None) -> Any:
        """As `xacro.parse`, of plain files without entities."""
        if source is not None:
            return plain(source, filename)
        path = Path(str(filename))
        with path.open("rb") as file:
            data = file.read(limit + 1 - total[0])
        total[0] += len(data)
        if total[0] > limit:
            raise _RefusedByGuard(f"it and what it includes have more than {limit} bytes")
        if b"<!DOCTYPE" in data or b"<!ENTITY" in data or b"\0" in data[:256]:
            raise _RefusedByGuard(f"{path} has a document type declaration (entities), or is no UTF-8")
        return xacro.xml.dom.minidom.parseString(data)

    plain = xacro.parse
    xacro.parse = read
    substitution_args._eval_find = find  # noqa: SLF001
    xacro.all_includes = []
    for name in order["arguments"]:
        if not isinstance(name, str):
            raise _RefusedByGuard("its arguments are no names")
    _guard([*order["roots"], *packages.values()])
    document: Any = xacro.process_file(order["file"], mappings=dict(order["arguments"]))
    return document.toxml()


def main() -> None:
    """Answer one order."""
    order = json.load(sys.stdin)
    for limit, value in ((resource.RLIMIT_AS, order["memory"]), (resource.RLIMIT_CPU, order["seconds"])):
        resource.setrlimit(limit, (value, value))
    answer, sys.stdout = sys.stdout, sys.stderr
    try:
        found = {"text": _expand(order)}
    except BaseException as error:  # noqa: BLE001 - whatever a program raises
        found = _told(error)
    text = json.dumps(found)
    answer.write(text)
    answer.flush()


def _told(error: BaseException) -> dict[str, str]:
    """The package that is needed, else what went wrong: xacro wraps the reasons of its errors."""
    chain: list[BaseException] = []
    waiting: list[BaseException | None] = [error]
    while waiting and len(chain) < 50:
        one = waiting.pop()
        if one is not None and one not in chain:
            chain.append(one)
            waiting += [getattr(one, "exc", None), one.__cause__, one.__context__]
    for one in chain:
        if isinstance(one, _MissingPackage):
            return {"package": str(one)}
    for one in chain:
        if isinstance(one, _RefusedByGuard):
            return {"error": str(one)}
    if isinstance(error, MemoryError | RecursionError):
        return {"error": f"its macros end in a {type(error).__name__}"}
    return {"error": f"{type(error).__name__}: {error}"[:600]}


if __name__ == "__main__":
    main()
