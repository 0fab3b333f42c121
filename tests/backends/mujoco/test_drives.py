"""u = kp (q* - q) + kd (qd* - qd) + ff, clipped: against its solution, blocked, and switched per env."""

import numpy as np
import pytest

from anysim.model.world import ControlMode


def test_a_free_joint_follows_the_solution(worlds, make):
    """Critically damped: q = 1 - (1 + w t) exp(-w t), at every control step within the step size's error."""
    inertia, kp = 0.1, 40.0
    w = np.sqrt(kp / inertia)
    dt = 1e-4
    engine = make(worlds.hinge(inertia, kp=kp, kd=2 * np.sqrt(kp * inertia), dt=dt))
    engine.set_control(position=[[1.0]])
    for step in range(1, 41):
        engine.step(50)
        t = step * 50 * dt
        assert engine.get_state().joint_pos[0, 0] == pytest.approx(1 - (1 + w * t) * np.exp(-w * t), abs=2e-3)
    engine.step(10000)
    assert engine.get_state().joint_pos[0, 0] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(("kp", "kd"), [(4500.0, 450.0), (400.0, 40.0)])
def test_stiff_drives_are_stable_at_2_ms(worlds, make, kp, kd):
    """Without any armature, with a limit that saturates on the way."""
    engine = make(worlds.hinge(0.05, kp=kp, kd=kd, limit=87.0))
    engine.set_control(position=[[0.3]])
    engine.step(2000)
    state = engine.get_state()
    assert state.joint_pos[0, 0] == pytest.approx(0.3, abs=1e-6)
    assert abs(state.joint_vel[0, 0]) < 1e-6


@pytest.mark.parametrize(("target", "limit"), [(0.5, np.inf), (2.0, 20.0), (0.0, 20.0)])
def test_a_blocked_joint_exerts_the_clipped_command(worlds, make, target, limit):
    """Pressed against its limit it gives kp (q* - q), or the effort limit; the reading says so too."""
    engine = make(worlds.hinge(0.05, kp=100.0, kd=10.0, limit=limit, lower=-1.0, upper=0.1))
    engine.set_control(position=[[target]])
    engine.step(1000)
    state = engine.get_state()
    wanted = np.clip(100.0 * (target - state.joint_pos[0, 0]), -limit, limit)
    assert state.joint_effort[0, 0] == pytest.approx(wanted, rel=1e-6, abs=1e-6)


def test_feed_forward_and_target_velocity_are_part_of_the_law(worlds, make):
    """Velocity target and effort add to the position term."""
    engine = make(worlds.hinge(1.0, kp=3.0, kd=5.0))
    engine.set_control(position=[[0.2]], velocity=[[0.4]], effort=[[0.7]])
    engine.step()
    state = engine.get_state()
    assert state.joint_effort[0, 0] == pytest.approx(3.0 * 0.2 + 5.0 * 0.4 + 0.7)


def test_modes_are_switched_per_env(worlds, make):
    """Position, velocity and effort control side by side, then all back to position."""
    engine = make(worlds.hinge(0.1, kp=50.0, kd=5.0), 3)
    engine.set_control_mode(ControlMode.VELOCITY, [1])
    engine.set_control_mode("effort", [2])
    engine.set_control(position=[[0.3]] * 3, velocity=[[0.0], [0.2], [9.9]], effort=[[0.0], [0.0], [0.05]])
    engine.step(500)
    state = engine.get_state()
    assert state.joint_pos[0, 0] == pytest.approx(0.3, abs=1e-6)
    assert state.joint_vel[1, 0] == pytest.approx(0.2, abs=1e-9)
    assert state.joint_effort[2, 0] == 0.05
    assert state.joint_vel[2, 0] == pytest.approx(0.05 * 1.0 / 0.1, rel=1e-9)
    engine.set_control_mode("position")
    engine.set_control(position=[[0.1]] * 3, velocity=[[0.0]] * 3, effort=[[0.0]] * 3)
    engine.step(2000)
    assert np.allclose(engine.get_state().joint_pos, 0.1, atol=1e-6)


def test_gains_and_limits_are_changed_per_env(worlds, make):
    """The next step has them."""
    engine = make(worlds.hinge(1.0, kp=10.0, kd=1.0), 3)
    engine.set_parameters("actuator.kp", [[20.0]], [1])
    engine.set_parameters("actuator.effort_limit", [[3.0]], [2])
    engine.set_control(position=[[1.0]] * 3)
    engine.step()
    assert np.allclose(engine.get_state().joint_effort[:, 0], [10.0, 20.0, 3.0])


def test_a_mode_switch_leaves_the_other_envs_bits(worlds, make, shake):
    """Per-env gains appear, and nobody else moves differently."""
    plain, mixed = make(worlds.scene(), 3), make(worlds.scene(), 3)
    mixed.set_control_mode("effort", [1])
    for a, b in zip(shake(plain), shake(mixed), strict=True):
        assert np.array_equal(a[[0, 2]], b[[0, 2]])


def test_the_mode_after_a_reset_is_the_worlds(worlds, make):
    """Commands return to holding the initial state."""
    engine = make(worlds.hinge(0.1, kp=50.0, kd=5.0), 2)
    engine.set_control_mode("effort", [1])
    engine.set_control(effort=[[1.0]] * 2)
    engine.step(10)
    engine.reset([1])
    engine.step(10)
    assert engine.get_state().joint_pos[1, 0] == 0.0


def test_a_mimic_joint_follows(worlds, make):
    """20 N on the follower: a third of a millimetre on 15 g fingers, less with armature."""
    for armature, gap in ((0.0, 4e-4), (0.1, 1e-4)):
        engine = make(worlds.gripper(armature))
        for _ in range(300):
            engine.apply_wrench([[[0.0, 20.0, 0.0, 0.0, 0.0, 0.0]]], [2])
            engine.step()
        left, right = engine.get_state().joint_pos[0]
        assert abs(left - right) < gap


def test_a_limit_gives_way_by_less_than_a_milliradian(worlds, make):
    """Pressed with 87 N m."""
    engine = make(worlds.hinge(0.1, mode="effort", lower=-1.0, upper=0.01))
    engine.set_control(effort=[[87.0]])
    furthest = 0.0
    for _ in range(200):
        engine.step()
        furthest = max(furthest, engine.get_state().joint_pos[0, 0])
    assert 0.0 < furthest - 0.01 < 1e-3


def test_limit_softness_is_softer(worlds, make):
    """The time constant of the World is what the constraint has."""
    furthest = []
    for softness in (0.0, 0.05):
        engine = make(worlds.hinge(0.1, mode="effort", lower=-1.0, upper=0.01, limit_softness=softness))
        engine.set_control(effort=[[20.0]])
        engine.step(1000)
        furthest.append(engine.get_state().joint_pos[0, 0] - 0.01)
    assert furthest[1] > 10 * furthest[0] > 0


def test_dry_friction_holds_and_lets_go(worlds, make):
    """95 % of it does not move the joint, 150 % accelerates it with the difference."""
    engine = make(worlds.hinge(0.1, mode="effort", friction=2.0), 2)
    engine.set_control(effort=[[1.9], [3.0]])
    engine.step(500)
    state = engine.get_state()
    assert abs(state.joint_pos[0, 0]) < 1e-5
    assert state.joint_vel[1, 0] == pytest.approx(1.0 / 0.1, rel=1e-6)


def test_gravity_compensation_holds_an_undriven_link(make, worlds):
    """No drift without any gain."""
    from dataclasses import replace

    from anysim.model.world import Physics

    world = worlds.hinge(0.1, mode="effort")
    arm = replace(
        world.bodies[1], gravity_compensation=True, inertial=world.bodies[1].inertial._replace(com=(0.3, 0.0, 0.0))
    )
    engine = make(replace(world, physics=Physics(), bodies=(world.bodies[0], arm)))
    engine.step(500)
    assert abs(engine.get_state().joint_pos[0, 0]) < 1e-12
