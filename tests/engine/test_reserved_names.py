"""Names of the base classes: an engine that takes one is refused, with the name, its class, the owner and a remedy."""

import re
from pathlib import Path

import pytest

from anysim.engine.base import SimEngine
from anysim.engine.reserved_names import reserved
from anysim.errors import EngineError
from anysim.testing import worlds
from anysim.testing.kinematic import NullEngine
from anysim_mechanics.one_world.base import OneWorldPerEnv

GUIDE = Path(__file__).parents[2] / "docs" / "write_an_engine.md"


def _store(self, value):
    self._state = value


def _table(self):
    def fill():
        self._records = {}

    fill()


def _unpacked(self):
    self.mine, self._dt = 1, 0.01


CLASHES = {
    "method": ("_chosen", "SimEngine", {"_chosen": lambda self: None}),
    "class attribute": ("_world", "EngineLifetime", {"_world": 3}),
    "property": ("_presence", "EngineLifecycle", {"_presence": property(lambda self: None)}),
    "assignment": ("_state", "EngineLifetime", {"_build": _store}),
    "in a function inside": ("_records", "EngineLifecycle", {"_build": _table}),
    "one of several": ("_dt", "EngineLifecycle", {"_build": _unpacked}),
    "in a setter": ("_state", "EngineLifetime", {"held": property(lambda self: 0, _store)}),
}


@pytest.mark.parametrize(("name", "owner", "content"), CLASHES.values(), ids=CLASHES)
def test_a_class_that_takes_a_name_cannot_be_made(name, owner, content):
    with pytest.raises(EngineError, match=rf"tests.*Clash .*'{name}', which belongs to {owner}.*another name"):
        type("Clash", (NullEngine,), {**content, "__module__": "tests.clash", "__qualname__": "Clash"})


@pytest.mark.parametrize("name", sorted(reserved(SimEngine)))
def test_every_name_is_refused(name):
    """Whatever the base classes keep, by assignment in a method of a stranger's class."""
    scope: dict[str, object] = {}
    exec(f"def _build(self, world, num_envs):\n    self.{name} = world", scope)
    with pytest.raises(EngineError, match=f"assigns, in _build.., '{name}'"):
        type("Clash", (SimEngine,), {"_build": scope["_build"]})


@pytest.mark.parametrize("name", ["_records", "_world", "_rebuild", "_lock", "index"])
def test_an_assignment_that_no_class_shows_is_found_at_the_build(name):
    class Sly(NullEngine):
        def _build(self, world, num_envs):
            super()._build(world, num_envs)
            setattr(self, name, world if name != "_world" else None)

    engine = Sly()
    with pytest.raises(EngineError, match=f"Sly assigns '{name}', which belongs to Engine.*another name"):
        engine.create_world(worlds.loose())


def test_names_of_its_own_and_primitives_are_free():
    class Fine(NullEngine):
        def _build(self, world, num_envs):
            super()._build(world, num_envs)
            self._envs, self._statement = self._envs, 1
            other = type("Other", (), {})()
            other._state = 1

    with Fine() as engine:
        engine.create_world(worlds.loose(), 2)
        engine.step()


def test_engines_in_a_step_pay_nothing():
    """Attributes of engines are plain: nothing stands between an assignment and its place."""
    assert NullEngine.__setattr__ is object.__setattr__
    assert NullEngine.__getattribute__ is object.__getattribute__


def test_the_guide_lists_the_names():
    listed = GUIDE.read_text().partition("<!-- reserved names -->")[2].partition("<!-- end -->")[0]
    assert set(re.findall(r"`(\w+)`", listed)) == set(reserved(OneWorldPerEnv))
