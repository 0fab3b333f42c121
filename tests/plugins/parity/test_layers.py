"""A wrong engine is found, in the layer where it is wrong."""

from functools import partial
from typing import ClassVar

import pytest

from anysim.engine.capability import Allowance
from anysim.engine.factory import create_simulation
from anysim.testing.kinematic import NullEngine
from anysim_parity.actuation import actuation_layer
from anysim_parity.asset import asset_layer
from anysim_parity.kinematics import kinematics_layer, random_positions
from anysim_parity.result import Layer
from anysim_parity.variants import loose, mechanisms
from anysim_parity.verdict import ANALYTIC, findings
from tests.plugins.parity import wrong

MUJOCO = partial(create_simulation, "mujoco")


def off(layer: Layer) -> set[tuple[str, str]]:
    """(engine, subject) of everything that is beyond its tolerance from the answer."""
    return {(f.first, f.subject) for f in findings(layer) if f.second == ANALYTIC and not f.agree}


def test_right_engines_agree_in_every_layer() -> None:
    engines = {"mujoco": MUJOCO, "null": NullEngine}
    for layer in (asset_layer(wrong.arm(), engines), kinematics_layer(wrong.arm(), engines)):
        assert off(layer) == set()
        assert layer.refused == {}
        assert all(f.agree for f in findings(layer))
        assert len(findings(layer)) > 5


def test_a_shifted_frame_is_a_matter_of_kinematics() -> None:
    engines = {"right": NullEngine, "wrong": wrong.Shifted}
    assert off(asset_layer(wrong.arm(), engines)) == set()
    layer = kinematics_layer(wrong.arm(), engines)
    assert off(layer) == {("wrong", "link position: largest error")}
    error = layer.measures[0].values["wrong"]
    assert error == pytest.approx(wrong.Shifted.SHIFT, rel=1e-9)
    gap = next(g for g in layer.gaps if g.subject == "link position")
    assert (gap.first, gap.second) == ("right", "wrong")
    assert gap.value == pytest.approx(wrong.Shifted.SHIFT, rel=1e-9)


def test_a_wrong_mass_is_a_matter_of_the_asset() -> None:
    layer = asset_layer(wrong.arm(), {"right": NullEngine, "wrong": wrong.Heavier})
    assert off(layer) == {("wrong", "mass"), ("wrong", "total mass")}
    measure = next(m for m in layer.measures if m.subject == "mass")
    assert measure.values["wrong"] == pytest.approx(0.1, rel=1e-6)
    assert "wrong: arm.first has 2.2 for 2" in measure.explanation


def test_what_an_engine_may_be_off_by_is_declared_and_no_more() -> None:
    class Admits(wrong.Heavier):
        audit_allowances: ClassVar = {
            name: Allowance(by, "it rounds") for name, by in (("mass", 0.11), ("total mass", 0.01))
        }

    layer = asset_layer(wrong.arm(), {"right": NullEngine, "wrong": Admits})
    beyond = {
        f.subject: f.declared for f in findings(layer) if {f.first, f.second} == {"right", "wrong"} and not f.agree
    }
    assert beyond == {"mass": True, "total mass": False}
    measure = next(m for m in layer.measures if m.subject == "mass")
    assert "wrong declares of mass: arm.first has 2.2 for 2, within the declared 11 %: it rounds" in measure.explanation


def test_a_mass_that_is_not_admitted_shows_in_the_mass_matrix() -> None:
    layer = kinematics_layer(wrong.arm(), {"right": MUJOCO, "wrong": wrong.altered(wrong.lighter)})
    assert off(layer) == {("wrong", "mass matrix: largest error of the kinetic energy")}


@pytest.mark.slow
@pytest.mark.parametrize("change", [wrong.softer, wrong.slower])
def test_a_wrong_drive_is_a_matter_of_actuation(change) -> None:
    engines = {"right": MUJOCO, "wrong": wrong.altered(change)}
    assert off(kinematics_layer(wrong.arm(), engines)) == set()
    layer = actuation_layer(wrong.arm(), engines)
    assert {engine for engine, _ in off(layer)} == {"wrong"}
    assert layer.plots
    assert all(plot.reference is not None for plot in layer.plots)


def test_an_engine_that_breaks_costs_the_others_nothing() -> None:
    def broken():
        raise RuntimeError("out of order")

    layer = kinematics_layer(wrong.arm(), {"broken": broken, "null": NullEngine})
    assert layer.refused == {"broken": "RuntimeError: out of order"}
    assert set(layer.measures[0].values) == {"null"}


def test_an_engine_without_forces_has_no_drives_to_compare() -> None:
    layer = actuation_layer(wrong.arm(), {"mujoco": MUJOCO, "null": NullEngine})
    assert "moves joints without forces" in layer.refused["null"]
    assert all(set(measure.values) == {"mujoco"} for measure in layer.measures)


def test_variants_hold_what_they_say() -> None:
    world = loose(wrong.arm())
    assert len(world.actuators) == len(world.joints) == 3
    assert world.physics.gravity == (0.0, 0.0, 0.0)
    assert all(j.damping == j.friction == 0.0 for j in world.joints)
    assert world.joints[1].armature == 0.1
    assert mechanisms(wrong.arm()).geoms == ()


def test_random_positions_are_those_of_the_seed_and_within_the_limits() -> None:
    import numpy as np

    world = wrong.arm()
    q = random_positions(world, 50, np.random.default_rng(3))
    np.testing.assert_array_equal(q, random_positions(world, 50, np.random.default_rng(3)))
    assert (q >= [j.lower for j in world.joints]).all()
    assert (q <= [j.upper for j in world.joints]).all()
