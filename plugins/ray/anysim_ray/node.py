"""A worker on a node of the cluster. Ray sends this module there whole, so that it can say what the node lacks."""

import os
import pickle  # noqa: TID251  as Ray with all that it carries; here what cannot be read is told in words
import socket
import sys
import tempfile
import traceback
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, NamedTuple

DONE, REFUSED, LACKING, BROKE = "done", "refused", "lacking", "broke"
"""What came of an item: a result; a sentence of anysim; the module that the node has not; a traceback."""


class Place(NamedTuple):
    """Where a worker is.

    Attributes:
        node: the name of its machine.
        folder: where it works; empty where the folder of the one that asks is not there.
        packages: versions of the distributions that offer something to anysim, by name.
    """

    node: str
    folder: str
    packages: dict[str, str]


def packages() -> dict[str, str]:
    """The versions of what offers something to anysim here, by distribution."""
    offered = entry_points()
    groups = [group for group in offered.groups if group.partition(".")[0] == "anysim"]
    found = [one for group in groups for one in offered.select(group=group)]
    return {one.dist.name: one.dist.version for one in found if one.dist is not None}


class Worker:
    """Does items one after the other with what it opens once."""

    def __init__(self, open_: bytes, cores: int, folder: str, path: Sequence[str]) -> None:
        """Begin.

        Args:
            open_: what gives the function that does an item, pickled.
            cores: of the node that it keeps to, where as many are free.
            folder: to work in, where it is there.
            path: of modules; what of it is there and is not on the path of the node is added.
        """
        self._held = keep_to(cores)
        self._open, self._treat, self._stack = open_, None, ExitStack()
        self._folder = folder if Path(folder).is_dir() else ""
        if self._folder:
            os.chdir(folder)
        sys.path.extend(part for part in path if part not in sys.path and Path(part).exists())

    def place(self) -> Place:
        """Where it is."""
        return Place(socket.gethostname(), self._folder, packages())

    def treat(self, item: bytes) -> tuple[str, Any]:
        """What came of an item: a word for it, and the result or why there is none."""
        try:
            if self._treat is None:
                opened = pickle.loads(self._open)  # noqa: S301
                self._treat: Callable[..., Any] | None = self._stack.enter_context(opened())
            assert self._treat is not None
            return DONE, self._treat(*pickle.loads(item))  # noqa: S301
        except ModuleNotFoundError as error:
            if error.name is not None:
                return LACKING, error.name
            return BROKE, traceback.format_exc()
        except Exception as error:  # noqa: BLE001  told to the one that asked
            if any(kind.__name__ == "AnysimError" for kind in type(error).__mro__):
                return REFUSED, str(error)
            return BROKE, traceback.format_exc()

    def close(self) -> None:
        """Close what it opened."""
        self._stack.close()


def keep_to(cores: int) -> list[int]:
    """Have this process run on `cores` cores that no other worker of the node has; the descriptors that hold them.

    Without it each engine would make threads for all cores of the node. Where not enough are free, nothing is held.
    """
    if not hasattr(os, "sched_setaffinity"):
        return []
    import fcntl

    folder = Path(tempfile.gettempdir()) / f"anysim-cores-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    held: dict[int, int] = {}
    for core in sorted(os.sched_getaffinity(0)):
        descriptor = os.open(folder / str(core), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)  # the kernel lets go of it when the worker ends
            held[core] = descriptor
        except OSError:
            os.close(descriptor)
        if len(held) == cores:
            os.sched_setaffinity(0, held)
            return list(held.values())
    for descriptor in held.values():
        os.close(descriptor)
    return []
