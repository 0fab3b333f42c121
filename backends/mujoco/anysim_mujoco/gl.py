"""OpenGL without a screen: one context per process, owned by one thread that all drawing is queued to.

MuJoCo's EGL and OSMesa modules set PYOPENGL_PLATFORM when they are imported, which happens here, at the first image;
the variable is put back to what it was. MUJOCO_GL is read and never written. (Where a user has set MUJOCO_GL, `import
mujoco` itself imports that module, and the variable stays.)
"""

import atexit
import importlib
import os
import queue
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from anysim.errors import CannotDraw, EngineError

T = TypeVar("T")
BACKENDS = ("egl", "osmesa")
SOFTWARE = ("llvmpipe", "softpipe", "swiftshader", "swrast", "software rasterizer")
"""Words in the names of drivers that need no graphics card."""

REMEDY = "install a software renderer, e.g. apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri (or libosmesa6)"


class GlThread:
    """The thread that owns the process's OpenGL context."""

    def __init__(self) -> None:
        self.backend = ""
        """Which of BACKENDS is in use, once there is a context."""
        self._jobs: queue.SimpleQueue[tuple[Callable[[], Any], Future[Any]] | None] = queue.SimpleQueue()
        self._context: Any = None
        self._thread = threading.Thread(target=self._serve, name="anysim-mujoco-gl", daemon=True)
        self._thread.start()

    def call(self, job: Callable[[], T]) -> T:
        """Run `job` on the thread and return its result, or raise what it raised."""
        if not self._thread.is_alive():
            raise EngineError("the drawing thread has ended with the process; draw before it exits")
        answer: Future[T] = Future()
        self._jobs.put((job, answer))
        return answer.result()

    def open(self, preference: str) -> None:
        """Make the context if there is none.

        Raises:
            EngineError: no backend works here, or another one than the one asked for is in use already.
        """
        self.call(lambda: self._open(preference))

    def driver(self) -> str:
        """What OpenGL calls its renderer; needs an open context."""

        def ask() -> str:
            from OpenGL import GL

            name: Any = GL.glGetString(GL.GL_RENDERER)
            return name.decode()

        return self.call(ask)

    def in_software(self) -> bool:
        """Whether no graphics card draws; needs an open context."""
        driver = self.driver().lower()
        return any(word in driver for word in SOFTWARE)

    def close(self) -> None:
        """Free the context and end the thread."""
        if self._thread.is_alive():
            self._jobs.put(None)
            self._thread.join(timeout=10)

    def _serve(self) -> None:
        while (item := self._jobs.get()) is not None:
            job, answer = item
            try:
                answer.set_result(job())
            except BaseException as error:  # noqa: BLE001  the caller's thread raises it
                answer.set_exception(error)
            del item, job, answer
        if self._context is not None:
            self._context.free()
            self._context = None

    def _open(self, preference: str) -> None:
        wanted = _order(preference)
        if self.backend:
            if preference not in ("auto", self.backend):
                raise EngineError(f"this process draws with {self.backend}; use gl: {self.backend} or another process")
            return
        reasons = []
        for name in wanted:
            try:
                context = _import_backend(name).GLContext(64, 64)
                context.make_current()
            except Exception as error:  # noqa: BLE001  PyOpenGL raises whatever its loader met
                _forget_pyopengl()
                reasons.append(f"{name}: {error or type(error).__name__}")
                continue
            self._context, self.backend = context, name
            # after MuJoCo's own exit function was registered, hence run before it
            atexit.register(self.close)
            return
        raise CannotDraw(f"MuJoCo cannot draw here ({'; '.join(reasons)}); {REMEDY}")


def _order(preference: str) -> tuple[str, ...]:
    """The backends to try."""
    if preference != "auto":
        return (preference,)
    asked = os.environ.get("MUJOCO_GL", "").lower()
    return (asked,) if asked in BACKENDS else BACKENDS


def _import_backend(name: str) -> Any:
    """MuJoCo's module of a GL backend, imported without leaving a trace in the environment."""
    before = os.environ.get("PYOPENGL_PLATFORM")
    try:
        return importlib.import_module(f"mujoco.{name}")
    finally:
        if before is None:
            os.environ.pop("PYOPENGL_PLATFORM", None)
        else:
            os.environ["PYOPENGL_PLATFORM"] = before


def _forget_pyopengl() -> None:
    """PyOpenGL binds one platform when it is imported; another can be tried after forgetting it."""
    for name in list(sys.modules):
        if name.partition(".")[0] == "OpenGL" or name.startswith(("mujoco.egl", "mujoco.osmesa")):
            del sys.modules[name]


_owner: tuple[int, GlThread] | None = None
_starting = threading.Lock()


def gl_thread() -> GlThread:
    """This process's GL thread, started when first asked for (a forked child starts its own)."""
    global _owner
    with _starting:
        if _owner is None or _owner[0] != os.getpid():
            _owner = os.getpid(), GlThread()
        return _owner[1]
