"""The Vulkan device that draws: one per process, chosen the first time something is drawn.

SAPIEN asks the environment for a driver once. Without a graphics card a software driver does; Chromium and Chrome bring
one (SwiftShader), which is looked for where Linux distributions put it.
"""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from anysim.c_output import quiet
from anysim.errors import CannotDraw, EngineError
from anysim_sapien.library import sapien

REMEDY = (
    "install a Vulkan driver, e.g. apt-get install chromium (its software driver is found by itself) or "
    "mesa-vulkan-drivers, in a fresh process; or name one: vulkan_icd=/path/to/icd.json"
)
VARIABLES = ("VK_DRIVER_FILES", "VK_ICD_FILENAMES")
SYSTEM = ("/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/etc/vulkan/icd.d")
SOFTWARE = (
    "/usr/lib/chromium/vk_swiftshader_icd.json",
    "/usr/lib/chromium-browser/vk_swiftshader_icd.json",
    "/usr/lib64/chromium-browser/vk_swiftshader_icd.json",
    "/opt/google/chrome/vk_swiftshader_icd.json",
    "/opt/microsoft/msedge/vk_swiftshader_icd.json",
)


SOFTWARE_NAMES = ("swiftshader", "llvmpipe", "lavapipe")
"""How the names of devices begin that compute on the CPU; SAPIEN's own `is_cpu` says no to SwiftShader."""


class Device(NamedTuple):
    """What draws: the driver's file (empty: as the environment says), its name, and whether it is the CPU."""

    icd: str
    name: str
    is_cpu: bool


def driver_file(option: str) -> str:
    """The driver's JSON file that an option means; empty where the environment or the system decides.

    Raises:
        EngineError: drawing is switched off, or there is no such file.
    """
    if option == "none":
        raise EngineError("this sapien engine draws nothing, by its option vulkan_icd=none; leave it at auto to draw")
    if option != "auto":
        if not Path(option).is_file():
            raise EngineError(f"there is no Vulkan driver file '{option}'; vulkan_icd takes auto, none or a path")
        return option
    if any(os.environ.get(name) for name in VARIABLES) or any(_files(folder) for folder in SYSTEM):
        return ""
    return next((path for path in SOFTWARE if Path(path).is_file()), "")


def _files(folder: str) -> list[Path]:
    return sorted(Path(folder).glob("*.json"))


@contextmanager
def _environment(icd: str) -> Iterator[None]:
    """The variables that name a driver, for the moment in which it is loaded."""
    before = {name: os.environ.get(name) for name in VARIABLES}
    if icd:
        os.environ.update(dict.fromkeys(VARIABLES, icd))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


_opened: Device | str | None = None
"""The device, or why there is none: SAPIEN does not look twice in one process."""

_kept: list[Any] = []
"""A render system that keeps the device: the last one to go would take it along, and the next would look anew."""

drawing = threading.RLock()
"""Held while anything is drawn: all scenes of a process share the device."""


def _open(icd: str) -> Device | str:
    """The device of a driver, or why there is none. Software drivers warn at length of what they lack."""
    failure = ""
    with _environment(icd), quiet() as words:
        try:
            _kept.append(sapien.render.RenderSystem())
        except RuntimeError as error:
            failure = str(error)
    if failure:
        return f"{words.after(failure)}; driver: {icd or 'none was found'}"
    device: Any = _kept[0].device
    software = str(device.name).lower().startswith(SOFTWARE_NAMES)
    return Device(icd, str(device.name), software or bool(device.is_cpu()))


def open_device(option: str) -> Device:
    """The process's device.

    Raises:
        EngineError: no driver works here, drawing is switched off, or another driver is in use already.
    """
    global _opened
    with drawing:
        icd = driver_file(option)
        if _opened is None:
            _opened = _open(icd)
        if isinstance(_opened, str):
            raise CannotDraw(f"SAPIEN cannot draw here ({_opened}); {REMEDY}")
        if option != "auto" and _opened.icd != icd:
            raise EngineError(
                f"this process draws with {_opened.icd or _opened.name} already; use that one or another process"
            )
        return _opened
