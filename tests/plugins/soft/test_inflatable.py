"""Inflatables: the strain of a membrane, the law of gases while squeezed, momentum, engines, refusals."""

import json
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.testing.engines import require_drawing, require_engine
from anysim_soft.inflatable import AIR, Inflatable, slopes, sphere, volume
from tests.contract.suite_runs import run
from tests.plugins.soft.softs import ALL, ENGINES, begun, run_of, wait
from tests.tiers import others

EACH = pytest.mark.parametrize("engine", ["mujoco", *(pytest.param(e, marks=pytest.mark.slow) for e in ENGINES[1:])])
BALLOON = {"kind": "inflatable", "radius": 0.1, "subdivisions": 1, "pressure": 500.0}


def test_a_sphere_is_closed_and_outward_and_its_slopes_are_those_of_its_volume():
    points, faces = sphere(2)
    assert points.shape == (162, 3)
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert (counts == 2).all()
    assert volume(points, faces) == pytest.approx(4 / 3 * np.pi, rel=0.04)
    slope, step = slopes(points, faces), np.zeros_like(points)
    step[17, 1] = 1e-6
    found = (volume(points + step, faces) - volume(points - step, faces)) / 2e-6
    assert slope[17, 1] == pytest.approx(found, rel=1e-6)
    assert np.abs(slope.sum(axis=0)).max() < 1e-14
    assert np.abs(np.cross(points, slope).sum(axis=0)).max() < 1e-14


@pytest.mark.parametrize("substeps", [2, pytest.param(6, marks=pytest.mark.slow)])
def test_it_is_as_large_as_a_membrane_under_its_pressure(substeps):
    """Strain p r (1 - nu) / 2 E t within 3 % after it was let go without weight, and p V = n R T to 1e-6."""
    balloon = {**BALLOON, "subdivisions": 2, "position": [0, 0, 1.0], "substeps": substeps}
    with begun(run_of(balloon, gravity=[0.0, 0.0, 0.0])) as (env, it):
        assert isinstance(it, Inflatable)
        points, _ = sphere(2)
        flat = volume(0.1 * points, it.faces)
        wait(env, 15)
        pressure = it.pressure[0]
        strain = (it.volume(0) / flat) ** (1 / 3) - 1
        assert strain == pytest.approx(pressure * 0.1 * (1 - 0.45) / (2 * 1e6 * 0.001), rel=0.03)
        assert pressure == pytest.approx(500.0, rel=0.01)
        assert (AIR + pressure) * it.volume(0) == pytest.approx(it.gas[0], rel=1e-6)


@EACH
def test_its_pressure_rises_while_it_is_squeezed_as_the_law_of_gases_has_it(engine):
    """A board on top: it sinks in, comes to rest, weighs what it weighs, and p V is what it was."""
    require_engine(engine)
    board = {"source": {"box": [0.3, 0.3, 0.02]}, "mass": 0.4}
    world = {"objects": {"board": board}, "layout": {"board": {"position": [0.0, 0.0, 0.225]}}}
    with begun(run_of({**BALLOON, "damping": 0.05}, engine, world)) as (env, it):
        assert isinstance(it, Inflatable)
        before, high = it.volume(0), it.x[0, :, 2].max()
        wait(env, 90)
        facts: Any = it.facts(0)["it"]
        assert facts["high"][2] < high - 0.01
        assert facts["volume"] < before
        assert facts["pressure"] > 520.0
        assert (AIR + facts["pressure"]) * facts["volume"] == pytest.approx(it.gas[0], rel=3e-5)
        force = np.mean([(wait(env), it.body_force(ALL)[0, 0, 2])[1] for _ in range(20)])
        assert force == pytest.approx(0.4 * 9.81, rel=0.05)


@EACH
def test_images_see_it(engine):
    require_drawing(engine)
    camera = {
        "look_at": [0, 0, 0.1],
        "from": [0.0, -0.6, 0.15],
        "size": [64, 48],
        "channels": ["rgb", "depth", "segmentation"],
    }
    with begun(run_of(BALLOON, engine, {"cameras": {"front": camera}})) as (env, it):
        seen = env.engine.render("front", channels=("rgb", "depth", "segmentation"))
        mine = seen["segmentation"][0] == it.setting.entities[0] + 1
        assert mine.sum() > 100
        assert seen["depth"][0][mine].min() == pytest.approx(0.5, abs=0.03)
        red = seen["rgb"][0][mine].mean(axis=0)
        assert red[0] > 1.5 * red[2]


@pytest.mark.parametrize("engine", [*others("pybullet"), pytest.param("mujoco", marks=pytest.mark.full)])
def test_the_suite_clears_it(engine, tmp_path: Path):
    """A balloon that falls onto a ball: snapshots, partial resets and steps, and what is lost, as the suite has it."""
    require_engine(engine)
    options = {"radius": 0.08, "subdivisions": 1, "position": [0.65, 0.0, 0.21], "pressure": {"range": [300.0, 500.0]}}
    words = ["-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "--pyargs", "anysim.testing.families"]
    words += ["--family", "inflatable", "--engine", engine]
    words += [w for key, value in options.items() for w in ("--family-option", f"{key}={json.dumps(value)}")]
    done = run(*words, folder=tmp_path)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]
    assert re.search(r"9 passed, 1 skipped", done.stdout), sys.version


def test_parameters_are_drawn_by_env():
    drawn = {
        "pressure": {"range": [300.0, 500.0]},
        "thickness": {"range": [0.001, 0.002]},
        "young": {"range": [1e6, 2e6]},
        "poisson": {"range": [0.3, 0.45]},
        "density": {"range": [900.0, 1100.0]},
        "damping": {"range": [0.01, 0.02]},
        "friction": {"range": [0.3, 0.9]},
        "drag": {"range": [0.0, 0.1]},
    }
    with begun(run_of({**BALLOON, **drawn}), num_envs=3, seed=2) as (env, it):
        assert isinstance(it, Inflatable)
        for column, key in enumerate(it.drawn_keys):
            assert len(set(it.values[:, column])) == 3, key
        assert len(set(it.gas)) == 3
        wait(env)
        skin = it.parameter("density", 2) * it.parameter("thickness", 2) * 4 * np.pi * 0.01
        assert it.facts(2)["it"]["mass"] == pytest.approx(skin)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"presure": 1.0}, r"families\.it\.presure.*did you mean 'pressure'"),
        ({"pressure": -1.0}, r"families\.it\.pressure"),
        ({"pressure": 20_000.0}, r"families\.it: 20000 Pa would stretch the skin by 55 %"),
        ({"subdivisions": 5}, r"families\.it\.subdivisions"),
    ],
)
def test_what_cannot_be_is_refused(change, words):
    with pytest.raises(anysim.errors.AnysimError, match=words), anysim.make(run_of({**BALLOON, **change})) as env:
        env.reset(seed=0)
