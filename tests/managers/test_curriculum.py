"""Curricula: how far values are spread follows each env's own success rate, in draws, snapshots and replays."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.errors import SpecError
from anysim.record.replay import replay
from anysim.task.env import TaskEnv
from anysim_recording.collector import Collector
from tests.task.helpers import BLOCKS, blocks

GROWING = "task.curriculum={far: {widens: [layout.red.x, task.command.goal.height], episodes: 2, step: 0.25}}"
WON = "task.success={there: {term: near, a: red, b: goal, tolerance: 9.0}}"
LOST = "task.horizon=1"


def levels_of(env: TaskEnv) -> list[float]:
    return [float(str(draws["curriculum/far"])) for draws in env.streams.draws]


def play(env: TaskEnv, episodes: int) -> list[list[float]]:
    """The levels (episodes, N) of episodes of one step."""
    seen: list[list[float]] = []
    for _ in range(episodes):
        env.reset()
        seen.append(levels_of(env))
        env.step(np.zeros((env.num_envs, env.action_dim)))
    return seen


def test_the_level_rises_with_success_after_each_block_of_episodes() -> None:
    with blocks(1, GROWING, WON) as env:
        assert play(env, 10) == [[x] for x in (0.0, 0.0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1.0, 1.0)]
        assert play(env, 4)[-1] == [1.0]


def test_the_level_falls_with_failure_and_ends_at_nothing() -> None:
    with blocks(1, GROWING, LOST, "task.curriculum.far.start=0.4") as env:
        assert np.allclose(play(env, 7), [[x] for x in (0.4, 0.4, 0.15, 0.15, 0.0, 0.0, 0.0)])


def test_between_the_rates_it_stays() -> None:
    with blocks(1, GROWING, LOST, "task.curriculum.far.demote=0", "task.curriculum.far.start=0.4") as env:
        assert play(env, 6) == [[0.4]] * 6


def test_an_episode_that_is_given_up_does_not_count() -> None:
    with blocks(1, GROWING, LOST, "task.curriculum.far.start=0.5", "task.horizon=8") as env:
        assert play(env, 6) == [[0.5]] * 6


@pytest.mark.parametrize(("around", "middle"), [(0.0, -0.4), (0.5, 0.0), (1.0, 0.4)])
def test_values_are_drawn_from_the_share_of_their_spread(around: float, middle: float) -> None:
    with blocks(64, GROWING, f"task.curriculum.far.around={around}", "task.curriculum.far.start=0.2") as env:
        env.reset(seed=3)
        x = np.array([draws["layout/red/x"] for draws in env.streams.draws], dtype=float)
        y = np.array([draws["layout/red/y"] for draws in env.streams.draws], dtype=float)
    low, high = middle + 0.8 * 0.2 * np.array([-around, 1.0 - around])
    assert low <= x.min()
    assert x.max() <= high
    assert np.ptp(x) > 0.8 * (high - low)
    assert np.ptp(y) > 0.6, "what no entry names has its whole spread"


def test_the_whole_spread_is_what_is_drawn_without_a_curriculum() -> None:
    drawn: list[list[object]] = []
    for overrides in ((GROWING, "task.curriculum.far.start=1"), ()):
        with blocks(3, *overrides) as env:
            env.reset(seed=7)
            drawn.append([draws["layout/red/x"] for draws in env.streams.draws])
    assert np.allclose(np.array(drawn[0], dtype=float), np.array(drawn[1], dtype=float), atol=1e-12)


def test_an_env_does_not_depend_on_the_others() -> None:
    rows: list[list[float]] = []
    for count in (1, 3):
        with blocks(count, GROWING, WON) as env:
            play(env, 5)
            rows.append([float(str(env.streams.draws[0][name])) for name in ("curriculum/far", "layout/red/x")])
    assert rows[0] == rows[1]


def test_a_snapshot_goes_on_with_the_count() -> None:
    with blocks(1, GROWING, WON) as env:
        play(env, 3)
        before = env.snapshot()
        onward = play(env, 3)
        env.reset_to(before)
        assert play(env, 3) == onward == [[0.25], [0.5], [0.5]]


class Still:
    """A policy that does nothing, for a task whose action has no components."""

    def begin(self, env_ids: np.ndarray) -> None:
        """Nothing to prepare."""

    def act(self, env_ids: np.ndarray) -> np.ndarray:
        """One env."""
        return np.zeros((1, 0))

    def gave_up(self, env_ids: np.ndarray) -> np.ndarray:
        """Never."""
        return np.zeros(len(env_ids), dtype=bool)

    solved = gave_up

    def ended(self, env: int, success: bool) -> dict[str, Any]:
        """Nothing to say."""
        del env, success
        return {}

    def describe(self, env: int) -> dict[str, Any]:
        """Nothing to say."""
        return {}


def test_a_recording_of_a_later_level_replays_to_the_bit(tmp_path: Path) -> None:
    with blocks(1, GROWING.replace("episodes: 2", "episodes: 1"), WON, "record.cameras=[]") as env:
        results = list(Collector(env, Still(), tmp_path, 3, 0).run())
    assert [result.success for result in results] == [True] * 3
    for number, level in enumerate((0.0, 0.25, 0.5)):
        again = replay(tmp_path / f"episodes/env_0000_episode_{number:04d}")
        assert again.manifest.drawn["curriculum/far"] == level
        assert again.identical


def test_without_asking_the_whole_spread_is_drawn() -> None:
    easy = {**BLOCKS, "task": {**BLOCKS["task"], "curriculum": {"far": {"widens": ["layout.red.x"]}}}}
    with anysim.make(easy) as env:
        env.reset(seed=0)
        assert "curriculum/far" not in env.streams.draws[0]
        assert env.streams.draws[0]["layout/red/x"] != 0.0


def test_what_the_chosen_level_fixes_has_no_spread() -> None:
    levels = ("levels.easy.world.layout.red.x=0.1", "level=easy")
    with blocks(1, GROWING, *levels) as env:
        env.reset()
        assert levels_of(env) == [0.0]
    with pytest.raises(SpecError, match="is not drawn in each episode"):
        blocks(1, GROWING.replace("layout.red.x", "layout.red.z"), *levels)


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("{far: {widens: [layout.rod.x]}}", "'layout.rod.x' is not drawn in each episode; did you mean 'layout.red.x'"),
        ("{far: {widens: [layout.table.position]}}", "is not drawn in each episode"),
        ("{a: {widens: [layout.red.x]}, b: {widens: [layout.red.x]}}", "'layout.red.x' is widened twice"),
        ("{far: {widens: [layout.red.x], promote: 0.3}}", "0.4 is above `promote`, 0.3"),
        ("{far: {widens: []}}", "task.curriculum.far.widens"),
    ],
)
def test_what_cannot_be_widened_is_refused_by_its_place(entry: str, words: str) -> None:
    with pytest.raises(SpecError, match=r"task\.curriculum") as caught:
        blocks(1, f"task.curriculum={entry}")
    assert words in str(caught.value)
