"""Soft matter on engines: momentum, images, recordings that replay, the suite, refusals at their lines."""

import re
from pathlib import Path

import numpy as np
import pytest

import anysim
from anysim.record.reader import open_trajectory
from anysim.record.replay import replay
from anysim.testing.engines import require_drawing, require_engine
from anysim_recording.collector import Collector
from tests.contract.suite_runs import run
from tests.plugins.soft.softs import ALL, ENGINES, begun, run_of, wait, with_ball
from tests.schemas.test_every_key import Still
from tests.tiers import in_turn

EACH = pytest.mark.parametrize("engine", ["mujoco", *(pytest.param(e, marks=pytest.mark.slow) for e in ENGINES[1:])])
EXACT = {"mujoco": 1e-6, "pybullet": 1e-6, "sapien": 1e-5}
BLOCK = {"kind": "deformable", "box": [0.1, 0.1, 0.05], "young": {"range": [1e4, 4e4]}}
ROPE = {"kind": "rope", "path": [[-0.1, 0, 0], [0.1, 0, 0]], "radius": 0.01, "segments": 10}
ROPE["density"] = {"range": [800.0, 1200.0]}
CLOTH = {"kind": "fem_cloth", "size": [0.12, 0.12], "points": [7, 7], "thickness": {"range": [0.0005, 0.001]}}
CLOTH["position"] = [0.0, 0.0, 0.01]
TOWEL = {"kind": "garment", "towel": [0.12, 0.12], "spacing": 0.02, "areal_density": {"range": [0.2, 0.4]}}
TOWEL["position"] = [0.0, 0.0, 0.01]
KINDS = {"deformable": BLOCK, "rope": ROPE, "fem_cloth": CLOTH, "garment": TOWEL}
STEPS = {"deformable": 20, "rope": 9, "fem_cloth": 20, "garment": 20}
SPREAD = {"garment": {"position": [0.0, 0.0, 0.08], "fixed": ["-x", "+x"]}}
SPREAD |= {"fem_cloth": {"position": [0.0, 0.0, 0.08], "fixed": ["-x", "+x"], "young": 1e6}}
"""Of a drop: what a ball would push aside, and what it rolls off, so that it does not meet the engine's ground."""
OF_EACH = pytest.mark.parametrize("kind", KINDS)
CAMERA = {"front": {"look_at": [0, 0, 0.03], "from": [0.0, -0.3, 0.15], "size": [128, 96]}}
CAMERA["front"]["channels"] = ["rgb", "depth", "segmentation"]


@OF_EACH
@EACH
def test_bodies_get_what_matter_loses(engine, kind):
    """A ball is thrown at matter without weight."""
    require_engine(engine)
    world = with_ball([0.01, 0.0, 0.64], 0.04, 0.2)
    matter = {**KINDS[kind], "position": [0.0, 0.0, 0.5]}
    with begun(run_of(matter, engine, world, gravity=[0.0, 0.0, 0.0])) as (env, it):
        body, thrown = int(it.met[0]), np.array([0.0, 0.0, -1.0])
        env.engine.set_body_state(twist=[[[*thrown, 0.0, 0.0, 0.0]]], bodies=[body], pose=None)
        wait(env, 10)
        ours = it.momentum(ALL)[0, :3]
        theirs = 0.2 * (env.engine.get_state().body_twist[0, body, :3] - thrown)
        assert np.abs(it.received[0, :3]).max() < 1e-9
        assert np.abs(theirs).max() > 0.003
        assert np.abs(ours + theirs).max() <= EXACT[engine] * np.abs(theirs).max()


@OF_EACH
@pytest.mark.slow
def test_one_drop_on_three_engines(kind):
    """A ball that falls onto matter on the ground: the same path within 1 mm."""
    paths = {}
    for engine in ENGINES:
        require_engine(engine)
        matter = {**KINDS[kind], **SPREAD.get(kind, {})}
        with begun(run_of(matter, engine, with_ball([0.01, 0.0, 0.12], 0.03, 0.1))) as (env, it):
            path = []
            for _ in range(STEPS[kind]):
                wait(env)
                path.append(env.engine.get_state().body_pose[0, it.met[0], :3].copy())
            paths[engine] = np.array(path)
            assert np.abs(it.given[0, 0, 2]) > 0.01
    for engine in ENGINES[1:]:
        assert np.abs(paths[engine] - paths["mujoco"]).max() < 1e-3, engine


@OF_EACH
@EACH
def test_images_see_matter_and_what_hides_it(engine, kind):
    require_drawing(engine)
    post = {"source": {"box": [0.006, 0.006, 0.3]}, "fixed": True}
    world = {"objects": {"post": post}, "layout": {"post": {"position": [0.0, -0.1, 0.15]}}, "cameras": CAMERA}
    with begun(run_of(KINDS[kind], engine, world)) as (env, it):
        seen = env.engine.render("front", channels=("rgb", "depth", "segmentation"))
        ids, mine = seen["segmentation"][0], it.setting.entities[0] + 1
        post_id = 1 + [entity.name for entity in env.engine.world.entities].index("post")
        assert (ids == mine).sum() > 60
        rows = np.flatnonzero((ids == mine).any(axis=1))
        middle = ids[rows.min() : rows.max() + 1, 63:65]
        assert (middle == post_id).mean() > 0.9
        view = env.engine.camera_view("front")
        away = np.linalg.norm(it.x[0] - view.pose[0, :3], axis=1)
        depth = seen["depth"][0][ids == mine]
        assert depth.min() > 0.7 * away.min()
        assert depth.max() < away.max() + 0.01
        tint, color = seen["rgb"][0][ids == mine].mean(axis=0), np.array(it.color)
        assert np.abs(tint / tint.sum() - color / color.sum()).max() < 0.05


@OF_EACH
@EACH
def test_recordings_replay_and_stream_points(engine, kind, tmp_path: Path):
    require_engine(engine)
    made = run_of(KINDS[kind], engine, with_ball([0.01, 0.0, 0.1], 0.03, 0.1))
    made |= {"record": {"keep": "all", "streams": {"matter": {"fps": 25}}}}
    made["task"]["horizon"] = 8
    with anysim.make(made, num_envs=2) as env:
        list(Collector(env, Still(env), tmp_path, 2, seed=1).run())
    for folder in sorted((tmp_path / "episodes").iterdir()):
        reader = open_trajectory(folder)
        rows = reader.stream("matter/it")
        assert rows.steps.tolist() == [0, 2, 4, 6, 8]
        middle = reader.states_from_reset("family_it_middle")
        np.testing.assert_allclose([p.mean(axis=0) for p in rows.values], middle[rows.steps], atol=1e-6)
        assert replay(folder).identical


HIGH = "position=[0.65,0.0,0.22]"
OPTIONS = {
    "deformable": ["box=[0.1,0.1,0.05]", HIGH, 'young={"range": [1e4, 4e4]}'],
    "rope": ["path=[[0,-0.2,0],[0,0.2,0]]", HIGH, 'density={"range": [800.0, 1200.0]}', "segments=12"],
    "garment": ["towel=[0.2,0.2]", "spacing=0.04", HIGH, 'areal_density={"range": [0.2, 0.4]}', "bending=2e-5"],
    "fem_cloth": ["size=[0.2,0.2]", "points=[6,6]", HIGH, 'thickness={"range": [0.0005, 0.001]}'],
}


@pytest.mark.parametrize(("kind", "engine"), in_turn(OPTIONS))
def test_the_suite_clears_it(kind, engine, tmp_path: Path):
    """Matter that falls onto a ball: snapshots, partial resets and steps, and what is lost, as the suite has it."""
    require_engine(engine)
    words = ["-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "--pyargs", "anysim.testing.families"]
    words += ["--family", kind, "--engine", engine, *(w for o in OPTIONS[kind] for w in ("--family-option", o))]
    done = run(*words, folder=tmp_path)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]
    assert re.search(r"9 passed, 1 skipped", done.stdout), done.stdout


def test_parameters_differ_by_env_and_are_the_same_by_seed():
    matter = {**BLOCK, "density": {"range": [500.0, 900.0]}, "position": {"range": [[0, 0, 0], [0.1, 0.1, 0]]}}
    with begun(run_of(matter), num_envs=3, seed=4) as (env, it):
        values, x = it.values.copy(), it.x.copy()
        density = values[:, it.drawn_keys.index("density")]
        assert len(set(density)) == 3
        assert np.ptp(x[:, 0, 0]) > 0.01
        env.reset(seed=4)
        assert np.array_equal(values, it.values)
        assert np.array_equal(x, it.x)
        facts = env.families.facts(1)["it"]
        assert facts["mass"] == pytest.approx(density[1] * 0.1 * 0.1 * 0.05)
        state = env.families.state("it")
        assert state.faces.max() < state.points.shape[1]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"yuong": 1e4}, r"families\.it\.yuong.*did you mean 'young'"),
        ({"poisson": 0.6}, r"families\.it\.poisson"),
        ({"fixed": ["x"]}, r"families\.it\.fixed"),
        ({"cells": [40, 40, 1]}, r"families\.it\.cells.*nodes"),
        ({"fixed": ["-x", "+x", "-y", "+y", "-z", "+z"], "cells": [1, 1, 1]}, None),
        ({"held": {"ball": 5.0}}, r"families\.it\.held\.ball"),
        ({"held": {"cup": 2.0}}, r"there is no body or object 'cup'"),
        ({"at": "cup"}, r"there is no body or object 'cup'"),
    ],
)
def test_what_cannot_be_is_refused(change, words):
    if words is None:  # the middle node of the only cell can still move
        with begun(run_of({**BLOCK, **change})) as (env, it):
            wait(env)
            assert np.isfinite(it.x).all()
        return
    with pytest.raises(anysim.errors.AnysimError, match=words), anysim.make(run_of({**BLOCK, **change})) as env:
        env.reset(seed=0)


def test_matter_that_is_not_finite_is_a_fault():
    with begun(run_of(BLOCK), num_envs=2) as (env, it):
        wait(env)
        it.state_row[1, 5] = np.nan
        wait(env)
        assert env.info["fault"].tolist() == [False, True]
        assert env.status.tolist() == ["running", "failed"]
