"""The curriculum of ground by the way that was commanded: its rule, its replay, and where it is not followed."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.errors import SpecError
from anysim.record.replay import replay
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from anysim_recording.collector import Collector
from tests.managers.test_curriculum import Still

SIZE, HORIZON = 4.0, 10
"""[m] of a tile, and steps of 0.5 s in an episode."""
ROLLING: dict[str, Any] = {
    "engine": "null",
    "physics": {"dt": 0.02, "control_dt": 0.5},
    "world": {
        "terrain": {
            "kind": "tiles",
            "cell": 0.2,
            "tiles": {"rows": 4, "size": SIZE, "columns": ["slopes", "pits"], "choose": "curriculum", "start": 0},
        },
        "objects": {"ball": {"source": {"sphere": 0.1}}},
        "layout": {"ball": {"position": [0.0, 0.0, 0.3]}},
    },
    "task": {
        "horizon": HORIZON,
        "command": {"go": {"term": "tasks.velocity", "forward": 0.4, "left": 0.3}},  # 2.5 m in an episode
        "observations": {"policy": ["last_action"]},
        "events": {"climb": {"term": "tasks.climb", "frame": "ball", "goal": "go", "when": "step"}},
    },
}


def moved_by(env: TaskEnv, away: list[float]) -> list[int]:
    """The levels after an episode of one step, in which each env's ball went so far from its tile's origin."""
    manager, n = env.scene.terrain, env.num_envs
    assert manager is not None
    manager.level[:] = 1
    root = env.engine.index.body("ball")
    pose = env.engine.get_state().body_pose[:, [root]].copy()
    pose[:, 0, :2] = env.scene.origin[:, :2] + np.outer(away, [0.6, -0.8])
    env.engine.set_body_state(pose, None, np.arange(n), [root])
    env.step(np.zeros((n, 0)))
    env.reset()
    return manager.level.tolist()


def test_half_a_tile_climbs_and_less_than_half_the_commanded_way_falls_back() -> None:
    with anysim.make(ROLLING, num_envs=6, curriculum=True) as env:
        env.reset(seed=0)
        assert moved_by(env, [2.05, 1.95, 1.30, 1.20, 0.0, 9.0]) == [2, 1, 1, 0, 0, 2]


def test_what_is_told_to_stand_is_not_put_back_for_standing() -> None:
    still = ["task.command.go.forward=0", "task.command.go.left=0"]
    with anysim.make(ROLLING, num_envs=2, curriculum=True, overrides=still) as env:
        env.reset(seed=0)
        assert moved_by(env, [0.0, 2.05]) == [1, 2]


def test_the_way_is_where_all_commands_lead() -> None:
    go = (
        "task.command.go={term: tasks.velocity, forward: {range: [-1, 1]}, left: 0, turn: {range: [-1, 1]}, every: 1.0}"
    )
    with anysim.make(ROLLING, num_envs=24, curriculum=True, overrides=[go]) as env:
        env.reset(seed=0)
        commands: list[np.ndarray] = []
        for _ in range(6):
            env.step(np.zeros((24, 0)))
            commands.append(env.scene.goals["go"].copy())
        commands.append(commands[-1])  # of the step in `moved_by`; the next is drawn after it
        levels = moved_by(env, [0.5] * 24)
        heading = np.concatenate([np.zeros((1, 24)), np.cumsum([0.5 * c[:, 2] for c in commands[:-1]], axis=0)])
        led = np.abs(sum(0.5 * c[:, 0] * np.exp(1j * h) for c, h in zip(commands, heading, strict=True)))
        expected = np.where(0.5 < 0.5 * led * HORIZON / 7, 0, 1)
        assert 4 < expected.sum() < 20
        assert levels == expected.tolist()


def test_without_a_curriculum_the_term_is_there_and_climbs_nothing() -> None:
    with anysim.make(ROLLING, num_envs=4) as env:
        env.reset(seed=0)
        seeds, before = env.streams.episode_seed.copy(), env.scene.origin.copy()
        env.step(np.zeros((4, 0)))
        env.reset(episode_seeds=seeds)
        assert (env.scene.origin == before).all()


def test_ground_without_tiles_is_refused_where_the_term_stands() -> None:
    with pytest.raises(SpecError, match="no levels to climb") as caught:
        anysim.make(ROLLING, overrides=["world.terrain.tiles=null", "world.terrain.kind=plane"], curriculum=True)
    assert caught.value.issues[0].path == "task.events.climb"


def test_recorded_episodes_of_all_levels_replay_to_the_bit(tmp_path: Path) -> None:
    """The ball is commanded to stand, and let go on a slope: what rolls off its tile is promoted."""
    require_engine("mujoco")
    overrides = [
        "engine=mujoco",
        "physics={dt: 0.005, control_dt: 0.05}",
        "task.horizon=40",
        "task.events.climb.promote=0.1",
        "world.terrain.tiles.columns=[{kind: slopes, slope: 0.5, platform: 0.4}, {kind: waves, platform: 0.4}]",
        "world.layout.ball.position={range: [[-0.9, -0.9, 0.5], [0.9, 0.9, 0.5]]}",
        "record={cameras: [], keep: all}",
    ]
    with anysim.make(ROLLING, num_envs=1, curriculum=True, overrides=overrides) as env:
        list(Collector(env, Still(), tmp_path, 5, 0).run())
    levels: list[float] = []
    for folder in sorted((tmp_path / "episodes").iterdir()):
        again = replay(folder)
        assert again.identical
        drawn = again.manifest.drawn
        assert drawn["terrain/kind"] == ("slopes", "waves")[int(drawn["terrain/column"])]
        levels.append(drawn["terrain/level"])
    assert levels[:4] == [0.0, 1.0, 2.0, 3.0]
