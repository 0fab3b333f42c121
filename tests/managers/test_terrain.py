"""Tiles of envs, curricula, appearance, and what moves with the ground."""

from typing import Any

import numpy as np
import pytest

import anysim
from anysim.errors import TaskError
from anysim.managers.terrain import TerrainManager
from anysim.task.env import TaskEnv

TILES: dict[str, Any] = {
    "engine": "null",
    "world": {
        "terrain": {
            "kind": "tiles",
            "cell": 0.2,
            "tiles": {"rows": 4, "size": 6.0, "columns": ["slopes", {"kind": "stairs", "weight": 3.0}]},
        },
        "robots": {"panda": {"robot": "franka_panda", "position": [0.1, -0.2, 0.3], "actions": {}}},
        "cameras": {"fixed": {"from": [2.0, 0.0, 1.0], "look_at": [0.0, 0.0, 0.0], "channels": []}},
    },
    "task": {
        "horizon": 4,
        "command": {"goal": {"term": "goal_at", "position": [0.5, 0.0, 0.4]}},
        "observations": {"policy": [{"term": "height_scan", "frame": "panda", "length": 1.0, "spacing": 0.5}]},
    },
}
CURRICULUM = "world.terrain.tiles.choose=curriculum"


def env_of(num_envs: int, *overrides: str, **more: Any) -> TaskEnv:
    return anysim.make(TILES, num_envs=num_envs, overrides=overrides, **{"curriculum": True, **more})


def terrain(env: TaskEnv) -> TerrainManager:
    assert env.scene.terrain is not None
    return env.scene.terrain


def test_robots_cameras_and_goals_stand_on_the_env_s_tile() -> None:
    with env_of(24) as env:
        env.reset(seed=0)
        origins = {(t.row, t.column): t.origin for t in env.engine.world.tiles}
        manager = terrain(env)
        wanted = np.array([origins[r, c] for r, c in zip(manager.level, manager.column, strict=True)])
        assert len(np.unique(manager.level)) == 4
        assert (env.scene.origin == wanted).all()
        base = env.engine.get_state().body_pose[:, env.engine.index.body("panda"), :3]
        assert base == pytest.approx(wanted + np.array([0.1, -0.2, 0.3]))
        assert env.engine.camera_poses("fixed")[:, :3] == pytest.approx(wanted + np.array([2.0, 0.0, 1.0]))
        assert env.scene.goals["goal"][:, :3] == pytest.approx(wanted + np.array([0.5, 0.0, 0.4]))


def test_columns_come_by_their_weights_and_draws_by_their_streams() -> None:
    with env_of(400, "world.robots={}", "task.observations.policy=[last_action]", "world.cameras={}") as env:
        env.reset(seed=3)
        manager = terrain(env)
        assert 0.68 < (manager.column == 1).mean() < 0.82
        assert [int(d["terrain/level"]) for d in env.streams.draws] == manager.level.tolist()
        first = (manager.level.copy(), manager.column.copy())
        with env_of(3, "world.robots={}", "task.observations.policy=[last_action]", "world.cameras={}") as few:
            few.reset(seed=3)
            assert terrain(few).level.tolist() == first[0][:3].tolist()
            assert terrain(few).column.tolist() == first[1][:3].tolist()


def test_levels_are_kept_promoted_demoted_and_drawn_anew_at_the_top() -> None:
    with env_of(32, CURRICULUM, "world.terrain.tiles.start=1") as env:
        env.reset(seed=0)
        manager = terrain(env)
        start = manager.level.copy()
        assert set(start) == {0, 1}
        env.reset()
        assert (manager.level == start).all()
        manager.promote(np.arange(0, 16))
        manager.demote(np.arange(16, 32))
        assert (manager.level == start).all(), "not before the next reset"
        mask = np.arange(32) % 2 == 0
        env.reset(mask=mask)
        expected = np.where(np.arange(32) < 16, start + 1, np.maximum(start - 1, 0))
        assert (manager.level == np.where(mask, expected, start)).all()
        env.reset()
        assert (manager.level == expected).all(), "each change counts once"
        manager.promote(np.arange(32), 4)
        env.reset()
        assert len(np.unique(manager.level)) == 4, "an env that has mastered the last level gets any"
        assert all("terrain/level" in draws for draws in env.streams.draws)


def test_an_env_of_a_curriculum_keeps_its_kind_of_ground() -> None:
    """So that its level is one of that kind; columns come by their weights over envs."""
    with env_of(
        200, CURRICULUM, "world.robots={}", "task.observations.policy=[last_action]", "world.cameras={}"
    ) as env:
        env.reset(seed=1)
        manager = terrain(env)
        column = manager.column.copy()
        assert 0.65 < (column == 1).mean() < 0.85
        for _ in range(3):
            manager.promote(np.arange(200), 3)  # most of them past the last level
            env.reset()
            assert (manager.column == column).all()
        assert [d["terrain/kind"] for d in env.streams.draws] == [("slopes", "stairs")[c] for c in column]
        assert [(d["terrain/level"], d["terrain/column"]) for d in env.streams.draws] == list(
            zip(manager.level.tolist(), column.tolist(), strict=True)
        )
        tile = manager.tile(7)
        assert (tile.row, tile.column) == (manager.level[7], column[7])
        assert tile.origin == tuple(env.scene.origin[7])


def test_who_does_not_learn_meets_all_levels_and_climbs_none() -> None:
    """An episode of an evaluation depends on its seed alone, not on the episodes of its env before."""
    event = "task.events.climb={frame: panda, promote: 0.0, demote: 0.0, term: climb_levels, when: step}"
    with env_of(40, CURRICULUM, "world.terrain.tiles.start=0", event, curriculum=False) as env:
        env.reset(seed=1)
        manager = terrain(env)
        assert set(manager.level) == {0, 1, 2, 3}
        seeds, origin = env.streams.episode_seed.copy(), env.scene.origin.copy()
        env.step(np.zeros((40, env.action_dim)))
        env.reset()
        env.reset(episode_seeds=seeds[::-1])
        assert (env.scene.origin == origin[::-1]).all()
        with pytest.raises(TaskError, match="curriculum=True"):
            manager.promote(np.array([0]))
        tiles = env.spec.world.terrain.tiling
        assert (tiles.choose, tiles.start) == ("draw", None)


def test_robots_start_on_the_platform_of_their_tile_with_a_spread() -> None:
    spread = "world.robots.panda.position={range: [[-0.8, -0.8, 0.0], [0.8, 0.8, 0.0]]}"
    with env_of(30, spread, "world.terrain.tiles.columns=[pits]") as env:
        env.reset(seed=0)
        base = env.engine.get_state().body_pose[:, env.engine.index.body("panda"), :3]
        assert base[:, 2] == pytest.approx(env.engine.world.ground.heights_at(base), abs=1e-6)
        away = (base - env.scene.origin)[:, :2]
        assert np.abs(away).max() <= 0.8
        assert (away.std(axis=0) > 0.3).all()


def test_snapshots_hold_level_and_origin() -> None:
    with env_of(6, CURRICULUM) as env:
        env.reset(seed=0)
        manager = terrain(env)
        manager.promote(np.array([1, 2]))
        kept = env.snapshot()
        before = (manager.level.copy(), env.scene.origin.copy(), env.scene.goals["goal"].copy())
        env.reset()
        after = (manager.level.copy(), manager.column.copy())
        env.reset()
        env.reset_to(kept)
        assert (manager.level == before[0]).all()
        assert (env.scene.origin == before[1]).all()
        assert (env.scene.goals["goal"] == before[2]).all()
        env.reset()
        assert (manager.level == after[0]).all(), "a promotion that waits is part of the snapshot"
        assert (manager.column == after[1]).all()


def test_ground_without_levels_refuses_promotions() -> None:
    with env_of(1) as env:
        env.reset(seed=0)
        with pytest.raises(TaskError, match="choose: curriculum"):
            terrain(env).promote(np.array([0]))


def test_the_term_promotes_envs_that_walk_far() -> None:
    event = "task.events.climb={frame: panda, promote: 1.0, demote: 0.4, term: climb_levels, when: step}"
    with env_of(3, CURRICULUM, event) as env:
        env.reset(seed=1)
        manager = terrain(env)
        manager.level[:] = 1
        root = env.engine.index.body("panda")
        pose = env.engine.get_state().body_pose[:, [root]].copy()
        pose[:, 0, :2] = env.scene.origin[:, :2] + np.array([[1.5, 0.0], [0.5, 0.5], [0.1, 0.1]])
        env.engine.set_body_state(pose, None, np.arange(3), [root])
        env.step(np.zeros((3, env.action_dim)))
        env.reset()
        assert manager.level.tolist() == [2, 1, 0]


def test_the_scan_is_the_ground_below_the_frame_in_its_heading() -> None:
    with env_of(8) as env:
        obs, _ = env.reset(seed=0)
        base = env.scene.frame("panda").position
        assert obs["policy"].shape == (8, 9)
        assert obs["policy"][:, 4] == pytest.approx(0.3, abs=1e-6), "the base is 0.3 m above its platform"
        x, y = np.meshgrid([-0.5, 0.0, 0.5], [-0.5, 0.0, 0.5])
        points = base[:, None, :2] + np.stack([x.ravel(), y.ravel()], axis=-1)
        assert obs["policy"] == pytest.approx(base[:, 2:] - env.engine.world.ground.heights_at(points), abs=1e-6)


def test_a_turned_frame_scans_along_its_heading() -> None:
    ramp = "world.terrain={kind: heightfield, heights: [[0.0, 0.0], [2.0, 2.0]], size: [4.0, 4.0]}"  # up along y
    with env_of(
        1, "world.terrain.tiles=null", "world.terrain.cell=0.1", ramp, "world.robots.panda.yaw=1.5707963267948966"
    ) as env:
        obs, _ = env.reset(seed=0)
        scan = obs["policy"][0].reshape(3, 3)  # across, along
        here = 0.3 - 0.5 * (2.0 - 0.2)
        assert scan == pytest.approx(np.tile([here + 0.25, here, here - 0.25], (3, 1)), abs=1e-6)


def test_the_colour_of_the_ground_is_drawn() -> None:
    colour = "world.terrain.color={choice: [red, green]}"
    with env_of(12, colour) as env:
        env.reset(seed=0)
        ground = [i for i, g in enumerate(env.engine.world.geoms) if g.name == "terrain"]
        seen = env.engine.get_parameters("geom.color", indices=ground)[:, 0, :3]
        assert {tuple(c) for c in np.round(seen, 2)} == {(1.0, 0.0, 0.0), (0.0, 0.5, 0.0)}
        drawn = [d["terrain/color"] for d in env.streams.draws]
        assert [c == "red" for c in drawn] == (seen[:, 0] == 1.0).tolist()


def test_a_colour_moves_no_tile() -> None:
    with env_of(5) as plain, env_of(5, "world.terrain.color={choice: [red, green]}") as more:
        plain.reset(seed=2)
        more.reset(seed=2)
        assert (terrain(plain).level == terrain(more).level).all()
        assert (plain.scene.origin == more.scene.origin).all()


def test_the_look_of_a_room_is_drawn_and_its_form_is_not() -> None:
    spec = {
        "engine": "null",
        "world": {
            "room": {
                "furniture": {"table": 1, "chair": 2},
                "wall_color": {"choice": ["white", "beige"]},
                "floor_color": {"range": [[0.3, 0.2, 0.1], [0.6, 0.5, 0.4]]},
                "furniture_color": {"choice": ["brown", "gray", "navy"]},
            }
        },
        "task": {"observations": {"policy": ["last_action"]}},
    }
    with anysim.make(spec, num_envs=16) as env:
        env.reset(seed=0)
        engine = env.engine
        names = [g.name for g in engine.world.geoms]

        def colors(geom: str) -> set[tuple[float, ...]]:
            rows = engine.get_parameters("geom.color", indices=[names.index(geom)])[:, 0]
            return {tuple(row) for row in np.round(rows, 6).tolist()}

        assert len(colors("room.wall0_0")) == 2
        assert colors("room.wall0_0") == colors("room.lintel0_0")
        assert len(colors("room.floor")) == 16
        assert len(colors("table.main0")) == 3
        drawn = env.streams.draws
        assert any(d["terrain/chair_0/color"] != d["terrain/chair_1/color"] for d in drawn)
        poses = engine.get_state().body_pose
        assert (poses == poses[:1]).all()


def test_a_replay_stands_on_the_level_that_the_record_says() -> None:
    """By the record's draws alone: another env, which has climbed nothing."""
    with env_of(1, CURRICULUM, "world.terrain.tiles.start=0") as env, env_of(1, CURRICULUM) as other:
        env.reset(seed=5)
        terrain(env).promote(np.array([0]), 2)
        env.reset()
        drawn, seed = dict(env.streams.draws[0]), env.streams.episode_seed.copy()
        assert terrain(env).level.tolist() == [2]
        assert drawn["terrain/level"] == 2.0
        other.reset(seed=1)
        assert terrain(other).column != terrain(env).column
        for manager in other.managers:
            manager.recall(0, drawn)
        other.reset(episode_seeds=seed)
        assert (other.scene.origin == env.scene.origin).all()
        assert dict(other.streams.draws[0]) == drawn
        other.reset(episode_seeds=seed)  # the record counts once
        assert terrain(other).level.tolist() == [2]
        terrain(other).demote(np.array([0]))
        other.reset()
        assert terrain(other).level.tolist() == [1]
