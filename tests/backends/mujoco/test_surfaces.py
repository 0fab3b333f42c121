"""Contacts: friction, softness, bounce."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.model.world import Body, BodyKind, Box, Geom, Inertial, Plane, Surface, World
from anysim_mujoco.mjcf.surfaces import damping_ratio, rebound


@pytest.mark.parametrize("restitution", [0.05, 0.1353, 0.3, 0.5, 0.9, 0.99])
def test_the_damping_ratio_inverts_the_rebound(restitution):
    """Over- and underdamped."""
    assert rebound(damping_ratio(restitution)) == pytest.approx(restitution, rel=1e-9)


def _bounce(engine) -> float:
    """Speed after the first impact over the speed before it."""
    speeds = []
    for _ in range(450):
        engine.step()
        speeds.append(engine.get_state().body_twist[0, 0, 2])
    speeds = np.array(speeds)
    impact = int(np.argmin(speeds))
    return float(-speeds[impact : impact + 60].max() / speeds[impact])


@pytest.mark.parametrize("restitution", [0.3, 0.5, 0.8])
@pytest.mark.parametrize("height", [0.3, 1.0])
def test_a_bouncy_ball_bounces_on_a_dull_ground(worlds, make, restitution, height):
    """The larger restitution of the pair decides, within what the capability declares."""
    assert _bounce(make(worlds.ball(height, surface=Surface(restitution=restitution)))) == pytest.approx(
        restitution, abs=0.07 if restitution < 0.5 else 0.04
    )


def test_the_bouncier_of_two_decides(worlds, make):
    """Whichever of the two it is."""
    low, high = Surface(restitution=0.3), Surface(restitution=0.6)
    for ball, ground in ((low, high), (high, low), (high, high)):
        assert _bounce(make(worlds.ball(0.5, surface=ball, ground=ground))) == pytest.approx(0.6, abs=0.04)


def test_a_dull_ball_stays_down(worlds, make):
    """MuJoCo's critically damped contact gives back an eighth of the speed, which is a sixtieth of the height."""
    assert _bounce(make(worlds.ball(0.3))) < 0.14


def _slope(angle: float, surface: Surface, ground: Surface) -> World:
    """A flat box on a plane turned about y by `angle` [rad]."""
    half = (0.1, 0.1, 0.02)
    turn = (0.0, np.sin(angle / 2), 0.0, np.cos(angle / 2))
    up = np.array([np.sin(angle), 0.0, np.cos(angle)]) * 0.02
    inertial = Inertial(1.0, inertia=(3.5e-3, 3.5e-3, 6.7e-3, 0.0, 0.0, 0.0))
    return World(
        bodies=(Body("box", BodyKind.FREE, position=tuple(up), quaternion=turn, inertial=inertial),),
        geoms=(
            Geom("ground", -1, Plane(), quaternion=turn, surface=ground),
            Geom("box", 0, Box(half), surface=surface),
        ),
    )


def _slide(engine) -> float:
    """The speed after one second."""
    engine.step(500)
    return float(np.linalg.norm(engine.get_state().body_twist[0, 0, :3]))


def test_friction_of_a_pair_is_the_larger_one(make):
    """On 0.4 rad (tan = 0.42): 0.8 on either side holds, 0.2 on both slides with g (sin - mu cos)."""
    slippery, rough = Surface(friction=0.2), Surface(friction=0.8)
    for ours, theirs in ((slippery, rough), (rough, slippery)):
        assert _slide(make(_slope(0.4, ours, theirs))) < 5e-3
    expected = 9.81 * (np.sin(0.4) - 0.2 * np.cos(0.4))
    assert _slide(make(_slope(0.4, slippery, slippery))) == pytest.approx(expected, rel=0.02)


def test_the_surface_of_higher_priority_decides_alone(make):
    """Also where it is the slippery one."""
    expected = 9.81 * (np.sin(0.4) - 0.2 * np.cos(0.4))
    world = _slope(0.4, Surface(friction=0.2, priority=1), Surface(friction=0.8))
    assert _slide(make(world)) == pytest.approx(expected, rel=0.02)


def test_softness_is_how_deep_a_body_sinks(worlds, make):
    """A longer time constant sinks deeper."""
    depths = []
    for softness in (0.0, 0.1):
        engine = make(worlds.ball(0.05, surface=Surface(softness=softness), ground=Surface(softness=softness)))
        engine.step(2000)
        depths.append(0.05 - engine.get_state().body_pose[0, 0, 2])
    assert depths[1] > 5 * depths[0] > 0


def test_torsional_friction_stops_a_spinning_ball(worlds, make):
    """Only where the surface asks for it."""
    left = []
    for torsional in (False, True):
        surface = Surface(torsional=torsional, torsional_friction=0.05)
        world = worlds.ball(0.05, surface=surface)
        engine = make(replace(world, physics=replace(world.physics, dt=0.002)))
        engine.step(200)
        engine.set_body_state(twist=[[[0.0, 0.0, 0.0, 0.0, 0.0, 20.0]]])
        engine.step(500)
        left.append(abs(engine.get_state().body_twist[0, 0, 5]))
    assert left[0] > 19.0
    assert left[1] < 0.1
