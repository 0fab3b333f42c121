"""Runs of Python, each in a process of its own, which does not load the libraries again.

A server has loaded what nearly every command of anysim loads, and forks for each run: what a run does to its process
ends with it, as with `subprocess.run`, in a third of the time. Where the start or the end of Python is tested (what an
import loads or costs, hash seeds, signals, what is taken apart at the end), use `subprocess`.
"""

import atexit
import gc
import json
import os
import runpy
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from select import select
from types import ModuleType
from typing import NamedTuple, NoReturn, TypedDict

LOADED = tuple(
    "anysim_schemas.load coal google.protobuf.descriptor_pb2 lxml.etree mcap.reader mcap.writer mujoco numba numpy "
    "pydantic rich.traceback scipy.ndimage scipy.spatial trimesh typer typer.main typer.rich_utils yaml".split()
)
"""No package that keeps state between its uses, starts threads when it is imported, or chooses plugins."""
OURS = tuple(
    "anysim_schemas anysim anysim_collect anysim_control anysim_inspect anysim_mcap anysim_mujoco anysim_recording "
    "anysim_skills anysim_urdf".split()
)
"""Packages all of whose modules are loaded: to import one does nothing else, which tests/imports holds."""


class Asked(TypedDict):
    """A run: its words, folder and environment, and the files for what it says."""

    words: list[str]
    cwd: str
    env: dict[str, str]
    out: str
    err: str


class Server(NamedTuple):
    """The process that forks, and the folder of what its runs say."""

    process: subprocess.Popen[str]
    folder: Path


def run(
    *words: str, cwd: Path | None = None, env: Mapping[str, str] | None = None, timeout: float = 300
) -> subprocess.CompletedProcess[str]:
    """`python words` in a forked process: a file, `-c CODE` or `-m MODULE`, and its arguments."""
    server = _server(os.getpid())
    out, err = server.folder / "out", server.folder / "err"
    environment = dict(os.environ if env is None else env)
    asked = Asked(words=[*words], cwd=str(cwd or Path.cwd()), env=environment, out=str(out), err=str(err))
    requests, answers = server.process.stdin, server.process.stdout
    assert requests is not None
    assert answers is not None
    requests.write(json.dumps(asked) + "\n")
    requests.flush()
    if not select([answers], [], [], timeout)[0]:
        _end(server)
        _server.cache_clear()
        raise subprocess.TimeoutExpired([sys.executable, *words], timeout)
    answer = answers.readline()
    assert answer, "the server that forks has ended"
    return subprocess.CompletedProcess(
        [sys.executable, *words], int(answer), out.read_text(errors="replace"), err.read_text(errors="replace")
    )


@cache
def _server(owner: int) -> Server:
    """The server of a process, begun with its first run and ended with it."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    process = subprocess.Popen(
        [sys.executable, "-P", __file__],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
        start_new_session=True,
    )
    server = Server(process, Path(tempfile.mkdtemp(prefix="anysim-forked-")))
    atexit.register(_end, server)
    return server


def _end(server: Server) -> None:
    """End the server, and what it runs."""
    with suppress(ProcessLookupError):
        os.killpg(server.process.pid, signal.SIGKILL)
    server.process.communicate()
    shutil.rmtree(server.folder, ignore_errors=True)


# ------------------------------------------------------------------------------------------------------ in the server


def _serve() -> None:
    """Load the libraries, and fork for each request."""
    for name in (*LOADED, *(module for package in OURS for module in _modules(package))):
        with suppress(ImportError):
            import_module(name)
    with suppress(ImportError):
        import_module("numba").njit(lambda: 0)()  # the first kernel loads half of numba
    gc.freeze()  # what is loaded is shared by all runs: a collection that looks at it would copy it
    while line := sys.stdin.buffer.readline():
        child = os.fork()
        if child == 0:
            _be(json.loads(line))
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)


def _modules(package: str) -> Iterator[str]:
    """A package and all that is in it but tests and programs."""
    yield package
    with suppress(ImportError):
        inside = import_module(package).__path__
        for found in walk_packages(inside, f"{package}."):
            if not {"testing", "__main__"} & {*found.name.split(".")}:
                yield found.name


def _be(asked: Asked) -> NoReturn:
    """Be the Python that was asked for, and end without taking apart what was loaded before."""
    code = 1
    try:
        _become(asked)
        _do(asked["words"])
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
    finally:
        if (error := sys.exception()) is not None:
            sys.excepthook(type(error), error, error.__traceback__)
        threading._shutdown()  # type: ignore[attr-defined]
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _become(asked: Asked) -> None:
    """Take the folder, the environment and the path that were asked for, and write to the files."""
    os.chdir(asked["cwd"])
    os.environ.clear()
    os.environ.update(asked["env"])
    for number, path in enumerate((os.devnull, asked["out"], asked["err"])):
        opened = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC if number else os.O_RDONLY, 0o600)
        os.dup2(opened, number)
        os.close(opened)
    sys.path[:0] = [folder for folder in asked["env"].get("PYTHONPATH", "").split(os.pathsep) if folder]


def _do(words: list[str]) -> None:
    """Run the code, module or file."""
    if words[0] == "-m":
        sys.path.insert(0, str(Path.cwd()))
        sys.argv = words[1:]
        runpy.run_module(words[1], run_name="__main__", alter_sys=True)
    elif words[0] == "-c":
        sys.path.insert(0, "")
        sys.argv = ["-c", *words[2:]]
        sys.modules["__main__"] = main = ModuleType("__main__")
        exec(compile(words[1], "<string>", "exec"), main.__dict__)
    else:
        sys.path.insert(0, str(Path(words[0]).parent))
        sys.argv = words
        runpy.run_path(words[0], run_name="__main__")


if __name__ == "__main__":
    _serve()
