"""External benchmarks: the contract, episodes with their verdicts, and `anysim evaluate BENCHMARK:TASK`."""

import json
import os
from collections.abc import Iterator
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from anysim import registry
from anysim.errors import PluginError, TaskError
from anysim_evaluation.cli import evaluate as cli
from anysim_evaluation.driver import Episode, episode_seeds
from anysim_evaluation.external.benchmark import ExternalStep, is_external, open_task
from anysim_evaluation.external.driving import drive_external, external_policy
from anysim_sapien import vulkan

app = typer.Typer()
app.command()(cli.evaluate)


class Walk:
    """A point on a line that begins at a place of the seed's: beyond +1 it has arrived, beyond -1 it has fallen."""

    low, high, horizon = np.array([-0.5]), np.array([0.5]), 20
    opened: ClassVar[list["Walk"]] = []

    def __init__(self) -> None:
        self.place, self.closed = 0.0, False
        self.actions: list[float] = []
        self.opened.append(self)

    def reset(self, seed: int) -> dict[str, Any]:
        self.place = 0.1 * (seed % 5)
        return {"place": np.array([self.place])}

    def step(self, action: Any) -> ExternalStep:
        self.actions.append(float(action[0]))
        self.place += float(action[0])
        return ExternalStep({"place": np.array([self.place])}, -abs(self.place), self.place < -1)

    def verdict(self) -> bool:
        return self.place > 1

    def close(self) -> None:
        self.closed = True


class Walks:
    """Walks of a point."""

    version = "walks 1.0"

    def tasks(self) -> list[str]:
        return ["Line-v0", "Long-v0"]

    def make(self, task: str) -> Walk:
        env = Walk()
        env.horizon = 20 if task == "Line-v0" else 2
        return env


def forth(obs: dict[str, Any]) -> Any:
    """Two steps at a time, farther than the bounds allow."""
    assert obs["place"].shape == (1, 1)
    return np.full((1, 2, 1), 0.9)


def back(obs: dict[str, Any]) -> Any:
    return np.full((1, 1), -0.4)


def wide(obs: dict[str, Any]) -> Any:
    return np.zeros((1, 3))


@pytest.fixture
def walks(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The benchmark `walks` is installed."""
    names, load = registry.names, registry.load

    def ours(kind: str) -> list[str]:
        return [*names(kind), *(["walks"] if kind == "benchmarks" else [])]

    monkeypatch.setattr(registry, "names", ours)
    monkeypatch.setattr(registry, "load", lambda kind, name: Walks if name == "walks" else load(kind, name))
    monkeypatch.syspath_prepend(Path(__file__).parent)
    Walk.opened.clear()
    yield
    assert all(env.closed for env in Walk.opened)


def episodes(policy: str, seeds: list[int], task: str = "Line-v0") -> list[Episode]:
    env = Walks().make(task)
    try:
        return list(drive_external(env, external_policy(env, policy), seeds))
    finally:
        env.close()


@pytest.mark.usefixtures("walks")
def test_an_episode_ends_with_the_verdict_with_the_environment_or_at_its_horizon() -> None:
    seeds = [0, 4]
    won = episodes("test_external:forth", seeds)
    assert [(e.seed, e.status, e.failure, e.steps) for e in won] == [(0, "success", "", 3), (4, "success", "", 2)]
    assert won[0].total_reward == pytest.approx(-(0.5 + 1.0 + 1.5))
    lost = episodes("test_external:back", seeds)
    assert [(e.status, e.failure, e.steps) for e in lost] == [("failed", "failed", 3), ("failed", "failed", 4)]
    late = episodes("zero", seeds, "Long-v0")
    assert [(e.status, e.failure, e.steps) for e in late] == [("truncated", "truncated", 2)] * 2


@pytest.mark.usefixtures("walks")
def test_chance_depends_on_the_episode_alone_and_stays_within_the_bounds() -> None:
    assert episodes("random", [3, 7]) == [*episodes("random", [7, 3])][::-1]
    actions = Walk.opened[0].actions
    assert np.abs(actions).max() <= 0.5
    assert len(set(actions)) == len(actions)


@pytest.mark.usefixtures("walks")
def test_what_is_no_policy_of_an_external_task_is_said() -> None:
    for name in ("expert", "expert:sigma=0.1", "model.onnx"):
        with pytest.raises(TaskError, match="expected random, zero or MODULE:FUNCTION"):
            episodes(name, [0])
    with pytest.raises(TaskError, match="a function in it"):
        episodes("test_external:nothing", [0])
    with pytest.raises(TaskError, match=r"gave \(1, 3\); expected an action \(1, 1\)"):
        episodes("test_external:wide", [0])
    for env in Walk.opened:
        env.low = np.array([-np.inf])
        with pytest.raises(TaskError, match="needs bounds"):
            external_policy(env, "random")


@pytest.mark.usefixtures("walks")
def test_a_task_is_external_by_its_benchmark() -> None:
    assert is_external("walks:Line-v0")
    assert is_external("wolks:Line-v0")
    assert not is_external("pick_cube")
    assert not is_external("anysim-tasks:pick_cube")
    assert not is_external("C:/task.yaml")
    with pytest.raises(
        TaskError, match=r"has no task 'Lin-v0'; did you mean 'Line-v0'\? \(its tasks: Line-v0, Long-v0"
    ):
        open_task("walks:Lin-v0")
    with pytest.raises(PluginError, match="no benchmark named 'wolks'"):
        open_task("wolks:Line-v0")


@pytest.mark.usefixtures("walks")
def test_the_command_goes_on_and_writes_the_same_files_as_for_our_tasks(tmp_path: Path) -> None:
    arguments = ["walks:Line-v0", "-p", "test_external:forth", "--out", str(tmp_path), "--json"]
    first = CliRunner().invoke(app, [*arguments, "-k", "2"], catch_exceptions=False)
    assert json.loads(first.stdout)["engines"]["walks"]["successes"] == 2
    told = json.loads(CliRunner().invoke(app, [*arguments, "-k", "5"], catch_exceptions=False).stdout)
    assert told["task"] == "walks:Line-v0"
    assert [e["seed"] for e in told["engines"]["walks"]["episodes"]] == episode_seeds("validation", 0, 5)
    assert [len(env.actions) for env in Walk.opened] == [3 + 2, 2 + 2 + 2]  # those of the first run are not run again
    assert "walks:Line-v0" in (tmp_path / "evaluation.html").read_text()
    assert json.loads((tmp_path / "evaluation.json").read_text()) == told


@pytest.mark.usefixtures("walks")
@pytest.mark.parametrize(
    "option", [["--engine", "mujoco"], ["--level", "L1"], ["-o", "task.horizon=3"], ["--videos", "1"], ["-n", "4"]]
)
def test_options_of_our_tasks_are_refused(option: list[str]) -> None:
    with pytest.raises(TaskError, match="a task of an external benchmark, which takes no such option"):
        CliRunner().invoke(app, ["walks:Line-v0", "-p", "zero", *option], catch_exceptions=False)


@pytest.mark.parametrize(
    ("name", "module"), [("maniskill", "mani_skill"), ("gymnasium-robotics", "gymnasium_robotics")]
)
def test_a_benchmark_that_is_not_installed_says_what_to_install(name: str, module: str) -> None:
    if find_spec(module) is not None:
        pytest.skip(f"{module} is installed")
    with pytest.raises(PluginError, match=rf"pip install.*\[{name}\]"):
        open_task(f"{name}:Anything-v0")
    assert name in registry.names("benchmarks")


PEERS = {"maniskill": "PickCube-v1", "gymnasium-robotics": "AdroitHandDoor-v1"}


@pytest.mark.parametrize("name", PEERS)
@pytest.mark.filterwarnings("ignore")  # peers warn of what they lack
def test_a_peers_environment_keeps_the_contract(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    module = name.replace("-", "_").replace("maniskill", "mani_skill")
    if find_spec(module) is None:
        pytest.skip(f"{module} is not installed: make test-maniskill")
    if (driver := vulkan.driver_file("auto")) and not any(map(os.environ.get, vulkan.VARIABLES)):
        monkeypatch.setenv("VK_ICD_FILENAMES", driver)  # ManiSkill's physics asks for a device
    benchmark, env = open_task(f"{name}:{PEERS[name]}")
    try:
        assert benchmark.version == f"{module} {metadata.version(module)}"
        assert PEERS[name] in benchmark.tasks()
        first = env.reset(5)
        acting = external_policy(env, "random")(5)
        shown = []
        for _ in range(3):
            stepped = env.step(acting({key: row[None] for key, row in first.items()})[0])
            assert np.isfinite(stepped.reward)
            assert env.verdict() is False
            shown.append(stepped.obs)
        assert {key: row.shape for key, row in shown[-1].items()} == {key: row.shape for key, row in first.items()}
        again = env.reset(5)
        assert all(np.array_equal(first[key], again[key]) for key in first)
        assert any(not np.array_equal(first[key], env.reset(6)[key]) for key in first)
        assert env.horizon > 0
    finally:
        env.close()
