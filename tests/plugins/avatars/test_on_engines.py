"""Avatars on engines: what they push and carry, recordings that replay, images and rays that see them, the suite."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.engine.factory import create_simulation
from anysim.record.reader import open_trajectory
from anysim.record.replay import replay
from anysim.testing.audit import audit
from anysim.testing.engines import require_engine
from anysim_recording.collector import Collector
from tests.contract.suite_runs import run
from tests.plugins.avatars.people import avatars, lived, run_of, wait
from tests.schemas.test_every_key import Still

ENGINES = ("mujoco", "pybullet", "sapien")
EACH = pytest.mark.parametrize("engine", ["mujoco", *(pytest.param(e, marks=pytest.mark.slow) for e in ENGINES[1:])])


def thing(size: list[float], mass: float, at: list[float], friction: float = 0.8) -> dict[str, Any]:
    box = {"source": {"box": size}, "mass": mass, "friction": friction}
    return {"objects": {"box": box}, "layout": {"box": {"position": at}}}


def box_of(env: anysim.TaskEnv) -> np.ndarray:
    return env.engine.get_state().body_pose[0, 0, :3].copy()


def pushed(engine: str) -> float:
    """[m] by which a crate goes that is pushed with both hands at 0.4 m/s."""
    world = thing([1.6, 1.0, 1.2], 20.0, [1.7, 0.0, 0.6], friction=0.3)
    do = [{"path": [[1.5, 0.0]], "speed": 0.4, "clip": "carry"}]
    *_, (env, _) = _all(run_of(do, engine, world=world, height=1.75, dt=0.002), 300)
    return env[0] - 1.7


def walked_into(engine: str) -> float:
    """[m] by which a low crate goes that is walked into at 1.2 m/s."""
    do = [{"path": [[2.5, 0.0]], "speed": 1.2}]
    world = thing([0.6, 1.0, 0.4], 12.0, [0.9, 0.0, 0.2])
    *_, (env, _) = _all(run_of(do, engine, world=world, height=1.75, dt=0.002), 250)
    return env[0] - 0.9


def carried(engine: str) -> float:
    """[m] by which a tray goes that lies on both forearms over a walk of 1.5 m."""
    world = thing([0.3, 0.5, 0.04], 1.0, [3.0, 3.0, 0.02])
    do = [{"clip": "carry", "seconds": 1.2}, {"path": [[1.5, 0.0]], "clip": "carry", "speed": 0.6}, "carry"]
    begin = np.zeros(3)
    for step, (env, _) in enumerate(lived(run_of(do, engine, world=world, height=1.75, dt=0.002), 330)):
        if step == 30:
            names = [body.name for body in env.engine.world.bodies]
            arms = [names.index(f"ann.{side}_{part}") for side in ("left", "right") for part in ("hand", "forearm")]
            there = env.engine.get_state().body_pose[0, arms, :3]
            x, y, top = *there.mean(axis=0)[:2], there[:, 2].max() + 0.1
            env.engine.set_body_state([[[x, y, top, 0, 0, 0, 1]]], np.zeros((1, 1, 6)), bodies=[0])
        if step == 55:
            begin = box_of(env)
        last = box_of(env)
    assert last[2] > 0.8, "it fell"
    return last[0] - begin[0]


def _all(run: dict[str, Any], steps: int) -> list[tuple[np.ndarray, int]]:
    return [(box_of(env), 0) for env, _ in lived(run, steps)]


@pytest.mark.slow
@pytest.mark.parametrize("probe", [pushed, walked_into, carried])
def test_engines_agree_on_what_people_do_to_things(probe):
    found = {engine: probe(engine) for engine in ENGINES if require_engine(engine)}
    middle = (max(found.values()) + min(found.values())) / 2
    assert all(abs(value / middle - 1) < 0.1 for value in found.values()), found
    if probe is carried:
        assert all(value == pytest.approx(1.5, abs=0.01) for value in found.values()), found


LIFE = [{"path": [[0.5, 0.3], [0.6, 1.0]], "gaze": "box", "reach": "box"}, {"clip": "talk", "seconds": 0.2}, "sit"]


@EACH
def test_recordings_replay_to_the_bit(engine: str, tmp_path: Path) -> None:
    require_engine(engine)
    run = run_of(
        LIFE,
        engine,
        count=2,
        x={"range": [-0.2, 0.2]},
        yaw={"range": [-1.0, 1.0]},
        num_envs=2,
        world=thing([0.2, 0.2, 0.3], 1.0, [0.5, 0.2, 0.15]),
    )
    run |= {"record": {"keep": "all"}}
    run["task"]["horizon"] = 60
    with anysim.make(run) as env:
        list(Collector(env, Still(env), tmp_path, 2, seed=1).run())
    folders = sorted((tmp_path / "episodes").iterdir())
    one, two = (open_trajectory(folder).states for folder in folders)
    assert one["family_ann_pos"].shape == (60, 2, 2)
    assert np.ptp(one["family_ann_pos"][:, 0], axis=0).max() > 0.4
    assert not np.array_equal(one["family_ann_pos"][0], two["family_ann_pos"][0])
    for folder in folders:
        result = replay(folder)
        assert result.identical
        assert result.drift.fields["family_ann_looks"].identical


@EACH
def test_what_if_begins_with_equal_people(engine: str) -> None:
    """Two futures of one moment: the same bits until something else is asked of one of them."""
    require_engine(engine)
    with anysim.make(run_of(LIFE, engine, num_envs=2, world=thing([0.2, 0.2, 0.3], 1.0, [0.5, 0.2, 0.15]))) as env:
        env.reset(seed=4)
        for _ in range(30):
            wait(env)
        moment = env.snapshot(np.array([True, False]))
        env.reset_to(moment, [0])
        env.reset_to(moment, [1])
        for _ in range(20):
            wait(env)
        state = env.engine.get_state().body_pose
        assert state[0].tobytes() == state[1].tobytes()
        from anysim_avatars.spec import ActionSpec

        avatars(env).do([ActionSpec(clip="wave")], np.array([1]))
        for _ in range(20):
            wait(env)
        state = env.engine.get_state().body_pose
        assert np.abs(state[0] - state[1]).max() > 0.05


@EACH
def test_engines_build_what_was_meant(engine: str) -> None:
    require_engine(engine)
    world = anysim.compile_world(run_of([], height=1.75, count=2))
    with create_simulation(engine) as simulation:
        simulation.create_world(world)
        lines = audit(simulation)
    assert len(lines) > 100
    assert [line for line in lines if line.ok is False] == []


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_images_and_rays_see_people(engine: str) -> None:
    require_engine(engine)
    world = {
        "cameras": {
            "front": {
                "from": [3.0, 0.0, 1.2],
                "look_at": [0.0, 0.0, 0.9],
                "size": [64, 64],
                "channels": ["segmentation"],
            }
        },
        "sensors": {
            "scan": {
                "sensor": "lidar",
                "frame": "post",
                "position": [0, 0, 0.0],
                "pattern": {"kind": "spinning", "elevations": [0.0], "columns": 72},
                "far": 5.0,
            }
        },
        "objects": {"post": {"source": {"box": [0.05, 0.05, 2.0]}, "fixed": True}},
        "layout": {"post": {"position": [1.5, 0.0, 1.0]}},
    }
    with anysim.make(run_of([], engine, world=world)) as env:
        env.reset(seed=0)
        ids = env.engine.render("front", channels=("segmentation",))["segmentation"][0]
        mine = next(i for i, e in enumerate(env.engine.world.entities, 1) if e.name == "ann")
        assert (ids == mine).sum() > 100
        assert env.sensors is not None
        ranges = env.sensors.reading("scan", "range")[0]
        assert ((ranges > 1.2) & (ranges < 1.5)).any()


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_the_suite_clears_them(engine: str, tmp_path: Path) -> None:
    require_engine(engine)
    options = [
        "count=2",
        'do=[{"path": [[0.4, 0.3], [0.5, 1.0]], "gaze": "ball", "reach": "ball"}, "talk"]',
        'x={"range": [-0.2, 0.2]}',
    ]
    words = ["-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "--pyargs", "anysim.testing.families"]
    words += ["--family", "avatar", "--engine", engine, *(w for o in options for w in ("--family-option", o))]
    done = run(*words, folder=tmp_path)
    assert done.returncode == 0, done.stdout[-3000:]
    assert re.search(rf"family avatar on {engine}: 9 passed, 1 skipped", done.stdout)
