"""Plugins that fail in whatever way cost themselves alone, and are told with their distribution and the remedy."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest

import anysim
from anysim import hooks, registry
from anysim.engine.factory import availability, create_simulation, runnable
from anysim.errors import AssetError, EngineError, PluginError, PluginFailure
from anysim.task.env import TaskEnv
from anysim_inspect.plugins import broken
from tests import forked
from tests.task.helpers import BLOCKS, blocks

PACKAGE, MODULE = "anysim-rotten", "anysim_rotten"
ENDINGS = {
    "sys.exit()": "import sys; sys.exit()",
    "sys.exit(0)": "import sys; sys.exit(0)",
    "an error": "raise OSError('no such display')",
    "no exception of Python's": "raise BaseException('neither fish nor fowl')",
}
Install = Callable[[Mapping[str, str], Mapping[str, str]], dict[str, str]]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Installs a distribution from entry points by group and modules by name; gives the environment of a process."""

    def make(groups: Mapping[str, str], modules: Mapping[str, str]) -> dict[str, str]:
        info = tmp_path / f"{MODULE}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {PACKAGE}\nVersion: 1.0\n")
        text = "\n".join(f"[{group}]\nrotten = {value}" for group, value in groups.items())
        (info / "entry_points.txt").write_text(text)
        package = tmp_path / MODULE
        package.mkdir()
        for name, code in modules.items():
            (package / f"{name}.py").write_text(code)
        monkeypatch.syspath_prepend(str(tmp_path))
        registry.refresh()
        return {**os.environ, "PYTHONPATH": str(tmp_path)}

    yield make
    monkeypatch.undo()
    for name in [name for name in sys.modules if name.partition(".")[0] == MODULE]:
        del sys.modules[name]
    registry.refresh()
    hooks.manager.cache_clear()


def anysim_command(environment: dict[str, str], *words: str) -> subprocess.CompletedProcess[str]:
    return forked.run("-m", "anysim.cli", *words, env=environment)


@pytest.mark.parametrize("how", ENDINGS)
@pytest.mark.parametrize("kind", registry.KINDS)
def test_a_plugin_whose_import_ends_is_an_error_with_its_package(install: Install, kind: str, how: str) -> None:
    install({f"anysim.{kind}": f"{MODULE}.ends:Thing"}, {"__init__": "", "ends": ENDINGS[how]})
    with pytest.raises(PluginError, match=rf"of {PACKAGE} does not load: .*pip uninstall {PACKAGE}"):
        registry.load(kind, "rotten")


def test_ctrl_c_is_not_a_plugin_failing(install: Install) -> None:
    install({"anysim.skills": f"{MODULE}.ends:Thing"}, {"__init__": "", "ends": "raise KeyboardInterrupt"})
    with pytest.raises(KeyboardInterrupt):
        registry.load("skills", "rotten")


@pytest.mark.slow
def test_every_list_goes_on_past_plugins_that_end(install: Install) -> None:
    """One distribution with a plugin of every kind, an observer among them; all of them call sys.exit."""
    groups = {f"anysim.{kind}": f"{MODULE}.ends:Thing" for kind in registry.KINDS}
    groups["anysim.robots"] = groups["anysim.tasks"] = f"{MODULE}.ends"
    groups["anysim"] = f"{MODULE}.ends"
    environment = install(groups, {"__init__": "", "ends": ENDINGS["sys.exit(0)"]})
    for kind in ("engines", "tasks", "robots", "skills", "terms", "textures"):
        done = anysim_command(environment, "list", kind, "--json")
        assert done.returncode == 0, done.stderr
        listed = {row["name"]: row for row in json.loads(done.stdout)}
        assert len(listed) > 1
        assert listed["rotten"]["from"] == PACKAGE
        assert "does not load" in listed["rotten"]["what"]
        assert f"the plugin 'rotten' of {PACKAGE} does not load: SystemExit: 0" in done.stderr
    assert "mujoco" in anysim_command(environment, "list", "engines").stdout
    rows = broken()
    assert {row.what for row in rows} == {
        *(f"{kind.removesuffix('s')}: rotten" for kind in registry.KINDS if kind != "engines"),
        f"observer: {PACKAGE}:rotten",
    }
    assert all(row.remedy == registry.remedy(PACKAGE) for row in rows)


def test_the_doctor_goes_on_past_a_plugin_that_kills_its_process(install: Install) -> None:
    groups = {"anysim.skills": f"{MODULE}.dies:Thing", "anysim.textures": f"{MODULE}.ends:Thing"}
    install(groups, {"__init__": "", "dies": "import os; os.abort()", "ends": ENDINGS["an error"]})
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", sys.path[0])
        found = {row.what: row for row in broken()}
    assert "SIGABRT" in found["skill: rotten"].found
    assert "no such display" in found["texture: rotten"].found
    assert len(found) == 2


ENGINE = """
from anysim.testing.kinematic import NullEngine


class Engine(NullEngine):
    name = "rotten"
"""


@pytest.mark.parametrize(
    ("body", "cause"),
    [
        ("    @classmethod\n    def availability(cls):\n        raise SystemExit(0)\n", "SystemExit: 0"),
        ("    @classmethod\n    def availability(cls):\n        return None\n", "returned a NoneType"),
    ],
)
def test_an_engine_that_cannot_say_whether_it_runs_is_left_out(install: Install, body: str, cause: str) -> None:
    install({"anysim.engines": f"{MODULE}.engine:Engine"}, {"__init__": "", "engine": ENGINE + body})
    with pytest.raises(PluginError, match=cause):
        availability("rotten")
    assert "rotten" not in runnable()
    assert "null" in runnable()


def test_an_engine_that_cannot_be_made_is_named(install: Install) -> None:
    body = "    def __init__(self, **options):\n        super().__init__(**options)\n        raise SystemExit(0)\n"
    install({"anysim.engines": f"{MODULE}.engine:Engine"}, {"__init__": "", "engine": ENGINE + body})
    with pytest.raises(PluginFailure, match=rf"the engine 'rotten' of {PACKAGE} failed: SystemExit: 0"):
        create_simulation("rotten")
    with pytest.raises(EngineError, match="turbo"):
        create_simulation("mujoco", turbo=True)


def test_a_builder_that_ends_is_named(install: Install) -> None:
    code = "def build(*, size: float = 1.0):\n    raise SystemExit(0)\n"
    install({"anysim.assets": f"{MODULE}.made:build"}, {"__init__": "", "made": code})
    with pytest.raises(
        AssetError, match=rf"objects.thing.source: the asset 'rotten' of {PACKAGE} failed: SystemExit: 0"
    ):
        anysim.compile_world({"world": {"objects": {"thing": {"source": {"procedural": "rotten"}}}}})


# ---------------------------------------------------------------------- observers


class Rotten:
    """Fails in every hook of a run."""

    def __init__(self) -> None:
        self.calls: list[str] = []


def _fail(hook: str, arguments: str) -> Callable[..., None]:
    made: dict[str, Callable[..., None]] = {}
    source = f"def {hook}(self, {arguments}):\n    self.calls.append({hook!r})\n    raise SystemExit({hook!r})\n"
    exec(source, made)  # pluggy looks at the names of functions and arguments
    return made[hook]


RUN_HOOKS = {
    "after_build": "env",
    "before_episode": "env, env_ids",
    "after_step": "env, result",
    "after_episode": "env, env_ids",
    "on_close": "env",
}
for _hook, _arguments in RUN_HOOKS.items():
    setattr(Rotten, _hook, hooks.hookimpl(_fail(_hook, _arguments)))


class Sound:
    """Sees what the others leave of a run."""

    def __init__(self) -> None:
        self.steps = 0

    @hooks.hookimpl
    def after_step(self) -> None:
        self.steps += 1


@pytest.fixture
def watched() -> Iterator[tuple[Rotten, Sound]]:
    """A rotten observer of the distribution anysim-rotten, called before a sound one."""
    observers = Sound(), Rotten()
    for observer, name in zip(observers, ("anysim-sound:eye", f"{PACKAGE}:window"), strict=True):
        hooks.manager().register(observer, name)
    yield observers[1], observers[0]
    for observer in observers:
        hooks.manager().unregister(observer)


def test_an_observer_that_raises_costs_nothing_and_is_told_once_with_a_count(watched: tuple[Rotten, Sound]) -> None:
    rotten, sound = watched
    with pytest.warns(hooks.ObserverWarning) as told:
        env = _run_to_the_end()
    assert env.status.tolist() == ["truncated", "truncated"]
    assert sound.steps == 3
    assert rotten.calls == ["after_build", "before_episode", *["after_step"] * 3, "after_episode", "on_close"]
    words = [str(one.message) for one in told]
    first = [w for w in words if "failed in after_step: SystemExit: after_step" in w]
    assert len(first) == 1
    assert f"the observer 'window' of {PACKAGE} failed" in first[0]
    assert registry.remedy(PACKAGE) in first[0]
    assert f"the observer 'window' of {PACKAGE} failed in after_step 3 times in this run" in words
    assert len(words) == len(RUN_HOOKS) + 1
    with pytest.raises(EngineError, match="was destroyed"):
        env.engine.get_state()


def test_by_choice_an_observer_that_raises_ends_the_run(watched: tuple[Rotten, Sound]) -> None:
    with pytest.raises(PluginFailure, match=rf"the observer 'window' of {PACKAGE} failed in after_build"):
        anysim.make(BLOCKS, strict_observers=True)


def test_nothing_that_on_close_does_keeps_the_engine() -> None:
    class Clinging:
        @hooks.hookimpl
        def on_close(self) -> None:
            raise KeyboardInterrupt

    clinging = Clinging()
    hooks.manager().register(clinging)
    try:
        for strict in (False, True):
            env = anysim.make(BLOCKS, strict_observers=strict)
            with pytest.raises(KeyboardInterrupt):
                env.close()
            with pytest.raises(EngineError, match="was destroyed"):
                env.engine.get_state()
    finally:
        hooks.manager().unregister(clinging)


def _run_to_the_end() -> TaskEnv:
    """Two envs without robots, whose episode has ended, closed."""
    with blocks(2, "task.horizon=3") as env:
        env.reset(seed=0)
        for _ in range(3):
            env.step(np.zeros((2, 0)))
    return env
