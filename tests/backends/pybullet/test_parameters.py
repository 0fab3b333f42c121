"""Surfaces and parameters beyond what the contract asks."""

import numpy as np
import pytest

from anysim.errors import EngineError
from anysim.model.world import Box, Sphere, Surface
from anysim.testing import worlds
from anysim.testing.sketch import Sketch
from anysim_pybullet.bullet import bullet
from anysim_pybullet.engine import PybulletEngine
from anysim_pybullet.urdf import roll_pitch_yaw


def _objects(*coefficients, ground=0.8):
    s = Sketch("objects")
    s.ground(Surface(friction=ground))
    for i, mu in enumerate(coefficients):
        s.free(f"b{i}", Box((0.1, 0.1, 0.1)), (float(i), 0.0, 0.1), surface=Surface(friction=mu))
    return s.world()


def _gaps(engine):
    """What Bullet has less what the rule wants, for the pairs of shapes that meet."""
    rules = engine._envs.plan.rules
    friction = engine._envs.parameters.values["geom.friction"][0, rules.geoms]
    values = rules.numbers(friction, np.zeros(len(friction))).friction
    return (np.multiply.outer(values, values) - rules.pair_friction(friction))[rules.weight > 0]


def test_equal_frictions_are_exact(build):
    """One coefficient throughout: every pair has it, with a shape each."""
    engine = build(_objects(0.8, 0.8, 0.8))
    assert len(engine._envs.plan.rules.geoms) == 4
    assert np.abs(_gaps(engine)).max() < 2e-4


def test_every_pair_has_one_meeting(build):
    """Where products cannot give the rule geoms get more shapes: each pair of geoms meets once, at its own value."""
    engine = build(_objects(0.2, 0.2, 0.5, 1.0))
    rules = engine._envs.plan.rules
    meetings = np.zeros((5, 5), dtype=int)
    np.add.at(meetings, (rules.geoms[:, None], rules.geoms[None, :]), (rules.weight > 0).astype(int))
    assert (meetings == 1 - np.eye(5, dtype=int)).all()
    assert np.abs(_gaps(engine)).max() < 2e-4


def test_changed_frictions_come_near(build):
    """Shapes are made for the World's coefficients: after a change the ground is right and free pairs pay for it."""
    engine = build(_objects(0.8, 0.8, 0.8, 0.8))
    engine.set_parameters("geom.friction", [[0.8, 0.2, 0.2, 0.5, 1.0]])
    rules = engine._envs.plan.rules
    friction = engine._envs.parameters.values["geom.friction"][0, rules.geoms]
    numbers = rules.numbers(friction, np.zeros(len(friction))).friction
    assert numbers[0] * numbers[1:] == pytest.approx([0.8, 0.8, 0.8, 1.0], abs=0.006)
    assert np.abs(_gaps(engine)).max() < 0.45


def test_changed_restitution_reaches_its_pairs_and_leaves():
    """The ground does not bounce: what one thing bounces with, it bounces with on the ground, and nothing else does."""
    engine = PybulletEngine()
    with engine.create_world(_objects(0.8, 0.8)):
        engine.set_parameters("geom.restitution", [[0.0, 0.6, 0.0]])
        rules, p = engine._envs.plan.rules, bullet()
        env, wanted = engine._envs.clients[0], rules.pair_restitution(np.array([0.0, 0.6, 0.0])[rules.geoms])
        found = [p.getDynamicsInfo(*env.shape_at[i], physicsClientId=env.id)[5] for i in range(len(rules.geoms))]
        ground = int(np.flatnonzero(rules.geoms == 0)[0])
        assert found[ground] * np.array(found)[rules.geoms == 1] == pytest.approx(
            wanted[ground][rules.geoms == 1], abs=0.02
        )
        engine.set_parameters("geom.restitution", [[0.0, 0.0, 0.0]])
        assert not any(p.getDynamicsInfo(*env.shape_at[i], physicsClientId=env.id)[5] for i in range(len(rules.geoms)))


def test_torsional_friction_slows_a_spin(build):
    """A ball that spins on the spot is slowed by its torsional coefficient times its weight."""
    s = Sketch("top")
    s.ground()
    s.free("ball", Sphere(0.1), (0.0, 0.0, 0.1), surface=Surface(torsional_friction=0.02, torsional=True))
    engine = build(s.world())
    engine.step(200)
    engine.set_body_state(twist=[0.0, 0.0, 0.0, 0.0, 0.0, 20.0])
    engine.step(100)
    lost = 20.0 - engine.get_state().body_twist[0, 0, 5]
    assert lost == pytest.approx(0.02 * 9.81 / 0.004 * 0.2, rel=0.02)


def test_axes_of_inertia_stay(build):
    """Moments may change along the axes of the build; a tensor with others is refused, and nothing is written."""
    engine = build(worlds.drifting())
    before = engine.get_parameters("body.inertia")
    turned = before.copy()
    turned[0, 0, 3] = 0.01
    with pytest.raises(EngineError, match="cannot turn the axes of inertia of body 'box0'"):
        engine.set_parameters("body.inertia", turned)
    assert np.array_equal(engine.get_parameters("body.inertia"), before)


def test_a_new_client_has_the_old_parameters(build):
    """An env that was given up gets a new client, with its parameters."""
    engine = build(worlds.falling_ball())
    engine.set_parameters("world.gravity", [[[0.0, 0.0, -2.0]]])
    engine.set_parameters("body.mass", [[3.0]])
    engine.set_body_state(twist=[1e12, 0.0, 0.0, 0.0, 0.0, 0.0])
    engine.step(3)
    assert engine.get_state().fault.all()
    engine.reset()
    engine.step(100)
    assert engine.get_state().body_twist[0, 0, 2] == pytest.approx(-0.4, rel=1e-6)
    assert engine.get_parameters("body.mass")[0, 0] == 3.0


@pytest.mark.parametrize("pitch", [0.0, 0.7, np.pi / 2, -np.pi / 2, 1.57079])
def test_angles_of_a_rotation(pitch):
    """Quaternion to roll, pitch, yaw and back, also where two of them turn about one axis."""
    from anysim.math import pose as P

    wanted = P.from_roll_pitch_yaw(np.array([0.4, pitch, -1.1]))
    got = P.from_roll_pitch_yaw(np.array(roll_pitch_yaw(wanted)))
    assert P.angle_between(wanted, got) < 1e-7


def test_an_audit_finds_the_world(build, own):
    """Masses, centres of mass, moments, limits and frames, as Bullet itself reports them, are the World's."""
    from anysim.testing.audit import audit

    lines = audit(build(own.skew_arm(free=True)))
    assert [line for line in lines if line.ok is False] == []
    for quantity in ("mass", "centre of mass", "principal moments", "limits", "frame"):
        assert any(line.quantity == quantity and line.ok for line in lines), quantity


def test_an_audit_of_a_robot_that_does_not_move_its_base(build):
    """The mass of a fixed base counts; limits at 0 are limits."""
    from anysim.api import compile_world
    from anysim.testing.audit import audit
    from anysim_bench.step import panda_and_boxes

    lines = audit(build(compile_world(panda_and_boxes())))
    assert [line for line in lines if line.ok is False] == []
