"""Engines by name: whatever is wrong with one is said with its name, its distribution and the cause."""

from importlib.metadata import EntryPoint
from types import SimpleNamespace

import pytest

from anysim import registry
from anysim.engine.factory import availability, create_simulation, engine_class
from anysim.errors import PluginError
from anysim.testing.kinematic import NullEngine


class Unsure(NullEngine):
    @classmethod
    def availability(cls):
        raise OSError("the driver does not answer")


class Undeclared(NullEngine):
    capabilities = None


def no_engine():
    return NullEngine()


def _offer(monkeypatch, **engines):
    """Install engines for the time of a test: name to attribute of this module."""
    module = "tests_of_the_factory"
    monkeypatch.setitem(__import__("sys").modules, module, SimpleNamespace(**globals()))
    known = registry.entry
    ours = {name: EntryPoint(name, f"{module}:{value}", "anysim.engines") for name, value in engines.items()}
    monkeypatch.setattr(registry, "entry", lambda kind, name: ours.get(name) or known(kind, name))


@pytest.mark.parametrize(
    ("value", "cause"),
    [
        ("Missing", "does not load: AttributeError"),
        ("no_engine", "is no subclass of anysim.engine.base.SimEngine"),
        ("Undeclared", "declares no capabilities"),
    ],
)
def test_what_is_no_engine_is_said(monkeypatch, value, cause):
    _offer(monkeypatch, odd=value)
    for look_up in (engine_class, availability, create_simulation):
        with pytest.raises(PluginError, match=rf"the engine 'odd' of .*{cause}.*tests_of_the_factory:{value}"):
            look_up("odd")


def test_an_engine_that_raises_instead_of_answering_is_named(monkeypatch):
    _offer(monkeypatch, unsure="Unsure")
    assert engine_class("unsure") is Unsure
    for look_up in (availability, create_simulation):
        with pytest.raises(PluginError, match=r"'unsure' of .* OSError: the driver does not answer"):
            look_up("unsure")


def test_a_sound_engine_answers():
    assert engine_class("null") is NullEngine
    assert availability("null").available
