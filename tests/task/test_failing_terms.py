"""Terms, controllers and skills that raise or return what does not fit: key, name and distribution are told."""

import json
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import anysim
from anysim import registry
from anysim.controllers.base import Command, Controller
from anysim.errors import AnysimError, PluginFailure, TaskError
from anysim.skills.base import Skill
from anysim.skills.runner import SkillPolicy
from tests.task.helpers import BLIND, BLOCKS

NOTHING = np.zeros((2, 0))
Installed = Callable[..., None]


@pytest.fixture
def odd(monkeypatch: pytest.MonkeyPatch) -> Iterator[Installed]:
    """Installs plugins of the distribution anysim-odd: terms by kind, a controller and a skill, all named `odd`."""
    from importlib.metadata import EntryPoint

    module = ModuleType("anysim_odd")
    sys.modules["anysim_odd"] = module
    known = registry.entry

    class OddEntry(EntryPoint):
        @property
        def dist(self) -> Any:
            return type("Dist", (), {"name": "anysim-odd"})

    entries = {
        (kind, "odd"): OddEntry("odd", f"anysim_odd:{kind}", f"anysim.{kind}")
        for kind in ("terms", "controllers", "skills")
    }
    monkeypatch.setattr(registry, "entry", lambda kind, name: entries.get((kind, name)) or known(kind, name))
    scan = {**registry._scan(), "anysim.odd": tuple(entries.values())}
    monkeypatch.setattr(registry, "_scan", lambda: scan)

    def install(**plugins: Any) -> None:
        for name, plugin in plugins.items():
            for thing in plugin.TERMS.values() if name == "terms" else [plugin]:
                for one in thing.values() if isinstance(thing, dict) else [thing]:
                    one.__module__ = "anysim_odd"
            setattr(module, name, plugin)

    yield install
    del sys.modules["anysim_odd"]


def term(kind: str, function: Callable[..., Any]) -> Any:
    return type("Library", (), {"TERMS": {kind: {"odd": function}}})


PLACES = {
    "reward": ("rewards", {"rewards": {"odd": {"term": "odd.odd"}}}, "task.rewards.odd"),
    "predicate": ("success", {"success": {"odd": {"term": "odd.odd"}}}, "task.success.odd"),
    "failure": ("failure", {"failure": {"odd": {"term": "odd.odd"}}}, "task.failure.odd"),
    "observation": (
        "observations",
        {"observations": {"policy": [{"term": "frame_pose", "frame": "red"}, {"term": "odd.odd"}]}},
        "task.observations.policy.1",
    ),
    "command": ("command", {"command": {"goal": {"term": "odd.odd"}}}, "task.command.goal"),
    "event": ("events", {"events": {"odd": {"term": "odd.odd", "when": "step"}}}, "task.events.odd"),
}


def run(place: str) -> None:
    """Build, reset and step the blocks with a section of their task in which a term is `odd.odd`."""
    section, changed, _ = PLACES[place]
    task = {**BLOCKS["task"], section: {**BLOCKS["task"].get(section, {}), **changed[section]}}
    with anysim.make({**BLOCKS, "task": task}, num_envs=2) as env:
        env.reset(seed=0)
        env.step(NOTHING)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("error", [ZeroDivisionError("no way"), SystemExit(0), TaskError("not like this")])
def test_a_term_that_raises_is_told_with_its_key(odd: Installed, place: str, error: BaseException) -> None:
    def raising(*_: Any) -> None:
        raise error

    odd(terms=term("predicate" if place == "failure" else place, raising))
    with pytest.raises(AnysimError) as told:
        run(place)
    text = str(told.value)
    assert f"{PLACES[place][2]}: the term 'odd.odd'" in text
    if isinstance(error, TaskError):
        assert text.endswith("not like this")
        return
    assert isinstance(told.value, PluginFailure)
    assert f"of anysim-odd failed: {registry.in_words(error)}; {registry.remedy('anysim-odd')}" in text


RETURNED = {
    "None": None,
    "a number": 1.0,
    "a list": [0.0, 0.0],
    "a row too few": np.zeros(1),
    "a matrix": np.zeros((2, 2, 2)),
    "text": np.array(["a", "b"]),
    "complex numbers": np.zeros(2, dtype=complex),
    "objects": np.array([None, None]),
}


@pytest.mark.parametrize("place", [place for place in PLACES if place != "event"])
@pytest.mark.parametrize("what", RETURNED)
def test_a_term_that_returns_what_does_not_fit_is_told_with_its_key(odd: Installed, place: str, what: str) -> None:
    odd(terms=term("predicate" if place == "failure" else place, lambda *_: RETURNED[what]))
    words = rf"{PLACES[place][2]}: the term 'odd.odd' of anysim-odd returned .*; expected an array of shape \(2,"
    with pytest.raises(TaskError, match=words):
        run(place)


def test_an_observation_that_changes_its_size_is_told(odd: Installed) -> None:
    sizes = iter((1, 1, 3))
    odd(terms=term("observation", lambda *_: np.zeros((2, next(sizes)))))
    words = re.escape("returned an array of shape (2, 3) of float64; expected an array of shape (2, 1) of numbers")
    with pytest.raises(TaskError, match=rf"task.observations.policy.1: .* {words}"):
        run("observation")


def test_numbers_are_no_truth_values(odd: Installed) -> None:
    odd(terms=term("predicate", lambda *_: np.ones(2)))
    with pytest.raises(TaskError, match=r"expected an array of shape .* of truth values"):
        run("predicate")


class Odd(Controller):
    dim = 1
    low, high = np.array([-1.0]), np.array([1.0])
    where = ""

    def __init__(self, channel: Any, num_envs: int, *, scale: float = 1.0) -> None:
        super().__init__(channel, num_envs)

    def reset(self, env_ids: Any, targets: Any) -> None:
        if self.where == "reset":
            raise SystemExit(0)

    def apply(self, action: Any, env_ids: Any) -> Any:
        if self.where == "apply":
            raise ZeroDivisionError("no way")
        return None if self.where == "None" else Command(np.zeros((7, 7, 7)))


@pytest.mark.parametrize(
    ("where", "cause"),
    [
        ("reset", "failed: SystemExit: 0"),
        ("apply", "failed: ZeroDivisionError: no way"),
        ("None", "not NoneType"),
        ("a wrong shape", "failed: ValueError"),
    ],
)
def test_a_controller_that_fails_is_told_with_its_key(odd: Installed, where: str, cause: str) -> None:
    odd(controllers=type("Odd", (Odd,), {"where": where}))
    changed = [*BLIND, "world.robots.panda.actions.arm={controller: odd}", "task.expert=null"]
    with anysim.make("pick_cube", engine="null", overrides=changed) as env:
        words = rf"world.robots.panda.actions.arm: the controller Odd.*{cause}"
        with pytest.raises(AnysimError, match=words):
            _reset_and_step(env)


class OddSkill(Skill):
    phases = ("only",)
    where = ""

    def __init__(self, env: Any, *, robot: str = "", object: str = "", goal: str = "") -> None:
        super().__init__(env)

    def act(self, env_ids: Any, action: Any) -> None:
        if self.where == "act":
            raise SystemExit(0)

    def describe(self, env: int) -> dict[str, object]:
        raise ZeroDivisionError("no way")


@pytest.mark.parametrize("where", ["act", "describe"])
def test_a_skill_that_fails_is_told_with_its_key(odd: Installed, where: str) -> None:
    odd(skills=type("OddSkill", (OddSkill,), {"where": where}))
    with anysim.make("pick_cube", engine="null", overrides=[*BLIND, "task.expert={skill: odd}"]) as env:
        env.reset(seed=0)
        policy = SkillPolicy(env)
        with pytest.raises(PluginFailure, match=r"task.expert: the skill 'odd' of anysim-odd failed: (System|ZeroD)"):
            _act_and_describe(policy)


def _reset_and_step(env: Any) -> None:
    env.reset(seed=0)
    env.step(np.zeros((1, env.action_dim)))


def _act_and_describe(policy: SkillPolicy) -> None:
    policy.begin(np.array([0]))
    policy.act(np.array([0]))
    policy.describe(0)


def test_what_fails_is_told_with_the_line_of_its_file(odd: Installed, tmp_path: Path) -> None:
    def raising(*_: Any) -> None:
        raise ZeroDivisionError("no way")

    odd(terms=term("reward", raising))
    file = tmp_path / "blocks.yaml"
    file.write_text(json.dumps(BLOCKS, indent=1).replace('"close": {', '"odd": {"term": "odd.odd"},\n    "close": {'))
    line = next(i for i, text in enumerate(file.read_text().splitlines(), 1) if "odd.odd" in text)
    with anysim.make(file) as env:
        env.reset(seed=0)
        with pytest.raises(PluginFailure, match=rf"blocks\.yaml:{line}:\d+: task\.rewards\.odd: the term"):
            env.step(NOTHING[:1])
    with anysim.make(BLOCKS, overrides=["task.rewards.odd={term: odd.odd}"]) as env:
        env.reset(seed=0)
        with pytest.raises(PluginFailure, match=r"^-o task\.rewards\.odd=.*: task\.rewards\.odd: the term"):
            env.step(NOTHING[:1])
