"""anysim: one YAML world and one MDP on any physics engine.

Importing this package imports nothing heavy: the names below are loaded when they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_LAZY = {
    "make": "anysim.api",
    "connect": "anysim.api",
    "load": "anysim.api",
    "compile_world": "anysim.api",
    "create_simulation": "anysim.engine.factory",
    "SimEngine": "anysim.engine.base",
    "World": "anysim.model.world",
    "TaskEnv": "anysim.task.env",
}
__all__ = [*_LAZY, "__version__"]

if TYPE_CHECKING:
    from anysim.api import compile_world as compile_world, connect as connect, load as load, make as make
    from anysim.engine.base import SimEngine as SimEngine
    from anysim.engine.factory import create_simulation as create_simulation
    from anysim.model.world import World as World
    from anysim.task.env import TaskEnv as TaskEnv


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module 'anysim' has no attribute '{name}'")
    return getattr(import_module(_LAZY[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
