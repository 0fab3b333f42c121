"""Physics of particle matter, against formulas, with the tolerances that the docs state."""

import numpy as np
import pytest

from tests.plugins.particles.matters import begun, in_tank, run_of, wait

ALL = np.array([0])


def column(spacing: float, edge: float, depth: float) -> dict:
    return {"kind": "fluid", "box": [edge, edge, depth], "spacing": spacing}


def test_a_fluid_has_its_level_and_presses_on_the_floor_with_its_weight():
    """Level within 5 %, and what the floor gives is the weight to 2 %."""
    edge, depth = 0.08, 0.06
    with begun(run_of(column(0.01, edge, depth), world=in_tank(edge, 0.15))) as (env, it):
        wait(env, 20)
        before, levels = it.received.copy(), []
        for _ in range(15):
            wait(env)
            levels.append(2 * it.x[0, :, 2].mean())
        x, v = it.x[0], it.v[0]
        assert np.mean(levels) == pytest.approx(depth, rel=0.05)
        assert np.sqrt((v**2).sum(axis=1).mean()) < 0.05
        # what the floor gives is what weight takes: nothing is left
        left = (it.received - before)[0, 2] / (15 * 0.02)
        assert abs(left) < 0.02 * edge * edge * depth * 1000 * 9.81
        assert np.abs(x[:, :2]).max() < edge / 2
        mass = float(it.particle_mass(ALL)[0]) * len(x)
        assert mass == pytest.approx(edge * edge * depth * 1000, rel=1e-9)


@pytest.mark.parametrize("drag", [0.0, 0.02])
def test_a_drop_slides_on_or_is_held_by_the_drag_of_what_it_lies_on(drag):
    """In each substep its share of the velocity goes, and the ground gets it; without drag it slides for ever."""
    matter = {**column(0.01, 0.01, 0.01), "drag": drag}
    with begun(run_of(matter, world={"terrain": "plane"})) as (env, it):
        wait(env, 5)
        before = it.received.copy()
        it.v[0, :, 0] = 0.5
        wait(env, 10)
        speed, substeps = it.v[0, 0, 0], 10 * 5 * 2
        assert it.v.shape[1] == 1
        assert speed == pytest.approx(0.5 * (1.0 - drag) ** substeps, rel=1e-6)
        given = (it.received - before)[0, 0]
        assert given == pytest.approx(float(it.particle_mass(ALL)[0]) * (speed - 0.5), rel=1e-6, abs=1e-9)


@pytest.mark.slow
def test_a_dam_that_breaks_runs_as_fast_as_shallow_water():
    """The front of a column of depth a, from 1.5 a to 3 a, runs at 0.6 to 1.05 of 2 sqrt(g a).

    That is Ritter's solution, without friction, and an upper bound; in experiments the front is slower.
    """
    a = 0.1
    matter = {**column(0.01, 0.1, a), "box": [a, 0.06, a], "position": [-0.3 + a / 2, 0.0, 0.0], "smoothing": 0.02}
    world = in_tank(0.06, 0.2)
    for name, place in (("west", [-0.31, 0.0, 0.1]), ("east", [0.31, 0.0, 0.1])):
        world["layout"][name]["position"] = place
    for name in ("south", "north"):
        world["objects"][name]["source"]["box"][0] = 0.6
    with begun(run_of(matter, world=world, control_dt=0.004)) as (env, it):
        times, fronts = [], []
        for step in range(1, 80):
            wait(env)
            times.append(step * 0.004)
            fronts.append((np.sort(it.x[0, :, 0])[-12] + 0.3 + 0.005) / a)
    fronts = np.array(fronts)
    first, last = np.argmax(fronts > 1.5), np.argmax(fronts > 3.0)
    speed = (fronts[last] - fronts[first]) * a / (times[last] - times[first])
    assert 0.6 < speed / (2 * np.sqrt(9.81 * a)) < 1.05


@pytest.mark.slow
@pytest.mark.parametrize("density", [300.0, 600.0])
def test_what_floats_is_as_deep_as_its_weight_says(density):
    """Within one spacing (12.5 mm) of Archimedes, and the mean force on it is its weight to 5 %."""
    box = {"source": {"box": [0.08, 0.08, 0.08]}, "density": density}
    matter = column(0.0125, 0.15, 0.125)
    with begun(run_of(matter, world=in_tank(0.15, 0.3, box=(box, [0.0, 0.0, 0.2])))) as (env, it):
        wait(env, 50)
        heights, forces = [], []
        for _ in range(15):
            wait(env)
            heights.append(env.engine.get_state().body_pose[0, it.met[0], 2])
            forces.append(it.body_force(ALL)[0, 0, 2])
        x = it.x[0]
        corner = x[np.abs(x[:, :2]).min(axis=1) > 0.05]
        level = np.sort(corner[:, 2])[-8:].mean() + 0.0125 / 2
        ideal = level + 0.04 - 0.08 * density / 1000
        assert np.mean(heights) == pytest.approx(ideal, abs=0.0125)
        assert np.mean(forces) == pytest.approx(density * 0.08**3 * 9.81, rel=0.05)


@pytest.mark.slow
def test_heaps_are_the_steeper_the_larger_friction_is():
    found = []
    for friction in (0.1, 0.3, 0.6):
        matter = {"kind": "sand", "cylinder": [0.05, 0.15], "radius": 0.005, "friction": friction}
        with begun(run_of(matter)) as (env, it):
            wait(env, 60)
            x = it.x[0]
            found.append(x[:, 2].mean() / np.hypot(*(x[:, :2] - x[:, :2].mean(axis=0)).T).mean())
            assert np.abs(it.v[0]).max() < 1.0
    assert found[0] < 0.85 * found[1] < 0.85 * found[2]


def test_grains_of_rice_stay_rigid_and_lie_down():
    matter = {"kind": "rice", "box": [0.025, 0.025, 0.015]}
    with begun(run_of(matter, world=in_tank(0.025, 0.05))) as (env, it):
        wait(env, 15)
        grains = it.x[0].reshape(-1, it.members(it.matter), 3)
        length = np.linalg.norm(grains[:, -1] - grains[:, 0], axis=1)
        np.testing.assert_allclose(length, 0.0045, rtol=0.02)
        assert it.x[0, :, 2].min() > 0.5 * 0.00125
        assert it.x[0, :, 2].max() < 0.015
        mass = float(it.particle_mass(ALL)[0]) * grains.shape[1]
        assert mass == pytest.approx(1450 * np.pi * 0.00125**2 * (0.0045 + 4 / 3 * 0.00125), rel=1e-9)
