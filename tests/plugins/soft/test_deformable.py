"""An elastic block against formulas, with the tolerances that the docs state."""

import numpy as np
import pytest

from tests.plugins.soft.softs import ALL, begun, run_of, wait, with_ball

BEAM = {"kind": "deformable", "box": [0.5, 0.05, 0.05], "position": [0.0, 0.0, 0.5], "young": 1e7, "damping": 0.05}


def tip_of(poisson: float, cells: list[int], seconds: float = 1.0, **change: object) -> float:
    """How far the end of a beam that is held at the other sank, as a share of what Euler and Bernoulli have."""
    matter = {**BEAM, "poisson": poisson, "cells": cells, "points": [9, 3, 3], "fixed": ["-x"], **change}
    with begun(run_of(matter)) as (env, it):
        end = it.x[0, :, 0] > 0.25 - 1e-9
        before = it.x[0, end, 2].mean()
        wait(env, round(seconds / 0.02))
        assert np.abs(it.v[0]).max() < 1e-3
        sunk = before - it.x[0, end, 2].mean()
    inertia = 0.05**4 / 12
    return sunk / (1000 * 0.05**2 * 9.81 * 0.5**4 / (8 * matter["young"] * inertia))


def test_a_beam_bends_as_euler_and_bernoulli_have_it():
    assert tip_of(0.0, [4, 1, 1]) == pytest.approx(1.0, abs=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(("poisson", "cells"), [(0.0, [8, 1, 1]), (0.3, [6, 2, 2])])
def test_beams_of_more_cells_do_too(poisson, cells):
    assert tip_of(poisson, cells) == pytest.approx(1.0, abs=0.03)


def test_a_bar_gets_longer_and_thinner_as_young_and_poisson_say():
    """Hung by one end, by its own weight: rho g L^2 / (2 E) longer, and thinner by Poisson's share."""
    young, length = 2e5, 0.2
    matter = {"kind": "deformable", "box": [0.05, 0.05, length], "position": [0.0, 0.0, 0.5], "young": young}
    matter |= {"poisson": 0.3, "damping": 0.1, "cells": [1, 1, 4], "points": [3, 3, 9], "fixed": ["+z"]}
    with begun(run_of(matter)) as (env, it):
        began = it.x[0].copy()
        wait(env, 40)
        bottom, middle = began[:, 2] < 0.5 + 1e-9, np.abs(began[:, 2] - 0.6) < 1e-9
        longer = (began - it.x[0])[bottom, 2].mean()
        width = np.ptp(it.x[0, middle, 0]) / 0.05 - 1.0
        strain = 1000 * 9.81 * (length / 2) / young
    assert longer == pytest.approx(1000 * 9.81 * length**2 / (2 * young), rel=0.03)
    assert width == pytest.approx(-0.3 * strain, rel=0.1)


def test_a_ball_rests_on_a_block_with_its_weight():
    matter = {"kind": "deformable", "box": [0.2, 0.2, 0.1], "young": 3e4}
    with begun(run_of(matter, world=with_ball([0.0, 0.0, 0.16]))) as (env, it):
        wait(env, 50)
        forces = []
        for _ in range(10):
            wait(env)
            forces.append(it.body_force(ALL)[0, 0, 2])
        assert np.mean(forces) == pytest.approx(0.5 * 9.81, rel=0.01)
        top = it.x[0, :, 2].max()
        ball = env.engine.get_state().body_pose[0, it.met[0], 2]
        assert 0.0 < top + 0.05 - ball < 0.01
        facts = env.families.facts(0)["it"]
        assert facts["mass"] == pytest.approx(4.0)


def test_air_slows_it_as_its_drag_says():
    matter = {"kind": "deformable", "box": [0.1, 0.1, 0.1], "position": [0, 0, 50.0], "drag": 2.0}
    with begun(run_of(matter)) as (env, it):
        wait(env, 50)
        speed = -it.v[0, :, 2].mean()
        assert speed == pytest.approx(9.81 / 2.0 * (1 - np.exp(-2.0)), rel=0.01)
        found = it.balance(ALL)
        lost = found.now - found.begun - found.received + found.given
        assert np.abs(lost[0, :3]).max() < 1e-9 * np.abs(found.received).max()


def test_a_body_that_something_else_holds_gets_all_of_its_impulse_a_little_later():
    """Four times as heavy for the matter and relaxed: at rest it is carried with its true weight, and none is lost."""
    matter = {"kind": "deformable", "box": [0.2, 0.2, 0.1], "young": 3e4, "held": {"ball": 4.0}}
    with begun(run_of(matter, world=with_ball([0.0, 0.0, 0.151]))) as (env, it):
        wait(env, 5)
        assert np.abs(it.pending).max() > 0
        found = it.balance(ALL)
        lost = found.now - found.begun - found.received + found.given
        assert np.abs(lost[0, :3]).max() < 1e-6 * np.abs(found.received).max()
        wait(env, 25)
        forces = []
        for _ in range(15):
            wait(env)
            forces.append(it.body_force(ALL)[0, 0, 2])
        assert np.mean(forces) == pytest.approx(0.5 * 9.81, rel=0.05)


def test_a_link_moves_matter_and_feels_it():
    """The door of a cabinet swings into a block: an impulse against its motion, and none is lost."""
    pytest.importorskip("anysim_assets")
    world = {"objects": {"arm": {"source": {"procedural": "hinge_box"}}}, "layout": {"arm": {"position": [0, 0, 0.2]}}}
    matter = {"kind": "deformable", "box": [0.06, 0.06, 0.06], "young": 3e4, "position": [0.0, 0.0, 0.45]}
    with begun(run_of(matter, world=world)) as (env, it):
        assert not env.engine.world.loose[it.met].all()
        wait(env, 15)
        found = it.balance(ALL)
        assert np.abs(found.given[0, :3]).max() > 0
        lost = found.now - found.begun - found.received + found.given
        assert np.abs(lost[0, :3]).max() < 1e-6 * np.abs(found.received[0, :3]).max()
        assert np.isfinite(it.x).all()
