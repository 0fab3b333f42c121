"""A sheet against formulas, with the tolerances that the docs state."""

import mujoco
import numpy as np
import pytest

from anysim.errors import PluginError
from anysim_soft.cloth import membrane
from tests.plugins.soft.softs import ALL, begun, run_of, wait, with_ball

G = 9.81


@pytest.mark.parametrize("poisson", [0.0, pytest.param(0.3, marks=pytest.mark.slow)])
def test_a_sheet_in_its_plane_stretches_as_young_and_poisson_say(poisson):
    """Pulled by a weight in its plane: longer by rho g L^2 / (2 E) within 3 %, and thinner by Poisson's share."""
    young, length, width = 1e6, 0.3, 0.1
    sheet = {"kind": "fem_cloth", "size": [length, width], "points": [13, 5], "young": young, "poisson": poisson}
    sheet |= {"density": 1000.0, "damping": 0.02, "fixed": ["-x"], "position": [0.0, 0.0, 1.0]}
    with begun(run_of(sheet, gravity=[G, 0.0, 0.0])) as (env, it):
        began = it.x[0].copy()
        wait(env, 30)
        moved = it.x[0] - began
        end, middle = began[:, 0] > length / 2 - 1e-9, np.abs(began[:, 0]) < 1e-9
        assert moved[end, 0].mean() == pytest.approx(1000 * G * length**2 / (2 * young), rel=0.03)
        narrower = np.ptp(it.x[0, middle, 1]) / width - 1.0
        assert narrower == pytest.approx(-poisson * 1000 * G * (length / 2) / young, rel=0.05, abs=1e-6)
        assert env.families.facts(0)["it"]["mass"] == pytest.approx(1000 * 0.001 * length * width)


@pytest.mark.parametrize(
    ("poisson", "stiffer"), [(0.0, 1.0), pytest.param(0.3, 1.0, marks=pytest.mark.slow), (0.0, 2.0)]
)
def test_a_strip_that_lies_on_its_ends_bends_as_a_plate(poisson, stiffer):
    """Edges that are fixed are hinges: sunk by 5 w L^4 / (384 D) within 6 %, D from thickness or given."""
    young, length, thickness = 1e9, 0.2, 0.005
    rigidity = stiffer * young * thickness**3 / 12
    sheet = {"kind": "fem_cloth", "size": [length, 0.1], "points": [9, 5], "young": young, "poisson": poisson}
    sheet |= {"density": 1000.0, "damping": 0.003, "fixed": ["-x", "+x"], "thickness": thickness, "radius": 0.001}
    sheet |= {"bending": rigidity} if stiffer > 1.0 else {}
    with begun(run_of({**sheet, "position": [0.0, 0.0, 1.0]})) as (env, it):
        wait(env, 20)
        assert np.abs(it.v[0]).max() < 1e-4
        middle = np.abs(it.x[0, :, 0]) < 1e-3
        sunk = 1.0 - it.x[0, middle, 2].mean()
    assert sunk == pytest.approx(5 * 1000 * thickness * G * length**4 / (384 * rigidity), rel=0.06)


@pytest.mark.parametrize("poisson", [0.0, 0.3])
def test_the_constants_in_the_model_are_those_of_the_formulas(poisson):
    """With MuJoCo 4 its own, which are right; 3.17 gets others."""
    young, thickness = 1e6, 0.001
    sheet = {"kind": "fem_cloth", "size": [0.3, 0.2], "points": [4, 4], "young": young, "poisson": poisson}
    with begun(run_of({**sheet, "thickness": thickness})) as (_, it):
        model = it.sub_world(0).model
        found, expected = model.flex_stiffness.reshape(-1, 21)[:, :6], membrane(model, young, poisson, thickness)
        assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()
        own = model.flex_bending.sum()
    with begun(run_of({**sheet, "thickness": thickness, "bending": 3 * young * thickness**3 / 12})) as (_, it):
        assert it.sub_world(0).model.flex_bending.sum() == pytest.approx(3 * own, abs=1e-12)


@pytest.mark.parametrize(
    "matter", [{"kind": "fem_cloth", "size": [0.3, 0.3]}, {"kind": "inflatable"}], ids=lambda matter: matter["kind"]
)
def test_a_mujoco_whose_constants_are_not_known_is_refused(monkeypatch, matter):
    monkeypatch.setattr(mujoco, "__version__", "4.1.0")
    words = r"families\.it: .* that MuJoCo 4\.1\.0 has .* install mujoco==3\.17\.0, or in its place mujoco-core=="
    with pytest.raises(PluginError, match=words), begun(run_of(matter)):
        pass


@pytest.mark.slow
def test_it_carries_a_ball_by_its_corners():
    """Hung from its corners, with a ball in it: the ball stays, and is carried with its weight."""
    sheet = {"kind": "fem_cloth", "size": [0.3, 0.3], "young": 1e6, "position": [0.0, 0.0, 0.5], "points": [13, 13]}
    sheet["fixed"] = ["-x-y", "-x+y", "+x-y", "+x+y"]
    with begun(run_of(sheet, world=with_ball([0.0, 0.0, 0.55], 0.04, 0.1))) as (env, it):
        wait(env, 60)
        forces = []
        for _ in range(20):
            wait(env)
            forces.append(it.body_force(ALL)[0, 0, 2])
        assert np.mean(forces) == pytest.approx(0.1 * G, rel=0.05)
        ball = env.engine.get_state().body_pose[0, it.met[0], :3]
        assert np.abs(ball[:2]).max() < 0.02
        assert ball[2] > 0.3
