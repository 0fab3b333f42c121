"""Engines that a test needs: the test is skipped where one cannot run."""

import os
from functools import cache

import pytest

from anysim.engine.base import SimEngine
from anysim.engine.capability import Capability
from anysim.engine.factory import availability, engine_class
from anysim.errors import CannotDraw, PluginError
from anysim.model.world import World

MUST_DRAW = "ANYSIM_MUST_DRAW"
"""Environment variable: the names of engines, or `all`, that are known to draw on this machine."""


def require_engine(name: str, *capabilities: Capability) -> type[SimEngine]:
    """The class of an installed engine that can run here and has these capabilities; else the test is skipped."""
    try:
        here, engine = availability(name), engine_class(name)
    except PluginError as error:
        pytest.skip(str(error))
    if not here.available:
        pytest.skip(f"{name} cannot run here: {'; '.join(here.missing)}")
    for capability in capabilities:
        if capability not in engine.capabilities:
            pytest.skip(f"{name} does not have '{capability}'")
    return engine


def require_drawing(engine: str | type[SimEngine]) -> None:
    """Skip the running test where this machine lacks what the engine needs to draw; it fails where it must not lack it.

    That is decided once, by an empty picture. Whatever goes wrong in drawing afterwards is an error.
    """
    kind = require_engine(engine) if isinstance(engine, str) else engine
    if trouble := drawing_trouble(kind):
        words = f"{kind.name} cannot draw here: {trouble.replace(',', ';')}"
        if {"all", kind.name} & set(os.environ.get(MUST_DRAW, "").split(",")):
            pytest.fail(f"{words}; {MUST_DRAW} says that it can")
        pytest.skip(words)


@cache
def drawing_trouble(engine_class: type[SimEngine]) -> str:
    """What this machine lacks for the engine to draw, or nothing: it says so by `CannotDraw`, and by no other error."""
    with engine_class() as engine:
        engine.create_world(World())
        try:
            engine.render(width=16, height=16)
        except CannotDraw as error:
            return str(error)
    return ""
