"""Engines that a test needs: the test is skipped where one cannot run."""

import pytest

from anysim.engine.base import SimEngine
from anysim.engine.capability import Capability
from anysim.engine.factory import availability, engine_class
from anysim.errors import PluginError


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
