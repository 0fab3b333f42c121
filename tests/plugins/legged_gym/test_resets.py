"""Resets, the past they end, domain randomization and pushes."""

import numpy as np
import pytest

from anysim.errors import AnysimError
from anysim_legged_gym.simulator import LeggedSimulator
from tests.plugins.legged_gym.simulators import ENGINES, ONE_FIRST, simulator

EVERYTHING = {
    "friction": [0.5, 1.25],
    "restitution": [0.0, 0.3],
    "added_base_mass": [-1.0, 1.5],
    "base_com_bias": [-0.03, 0.03],
    "joint_armature": [0.008, 0.012],
    "kp_scale": [0.9, 1.1],
    "kd_scale": [0.9, 1.1],
    "ctrl_delay": [0, 2],
}


def walk(sim: LeggedSimulator, steps: int, seed: int = 0) -> None:
    draws = np.random.default_rng(seed)
    for _ in range(steps):
        sim.step(draws.normal(scale=0.5, size=(sim.num_envs, sim.num_actions)))


@pytest.mark.parametrize("engine", ENGINES)
def test_a_reset_is_seen_at_once_and_leaves_the_others_alone(engine: str) -> None:
    with simulator(engine, 3, init_state={"lin_vel": [0.2, 0.0, 0.0]}) as sim:
        first, heights = sim.base_pos, sim.measured_heights
        walk(sim, 3)
        moved, forces = sim.base_pos, sim.link_contact_forces
        assert np.abs(sim.last_dof_vel).max() > 0.1
        sim.reset_idx([1])
        np.testing.assert_allclose(sim.base_pos[1], first[1], atol=1e-6)
        np.testing.assert_allclose(sim.dof_pos[1], sim.default_dof_pos, atol=1e-6)
        np.testing.assert_allclose(sim.base_lin_vel[1], [0.2, 0.0, 0.0], atol=1e-6)
        np.testing.assert_array_equal(sim.base_pos[[0, 2]], moved[[0, 2]])
        np.testing.assert_allclose(sim.link_contact_forces[[0, 2]], forces[[0, 2]], atol=1e-6)
        np.testing.assert_array_equal(sim.measured_heights, heights)
        for name in ("torques", "last_actions", "last_dof_vel", "last_torques", "last_base_lin_vel", "last_feet_vel"):
            assert not getattr(sim, name)[1].any(), name
            assert getattr(sim, name)[0].any(), name
        assert not sim.link_contact_forces[1].any()


def test_last_values_are_those_before_the_step() -> None:
    with simulator("mujoco") as sim:
        walk(sim, 2)
        before = {name: getattr(sim, name) for name in ("dof_pos", "dof_vel", "torques", "base_lin_vel", "actions")}
        sim.step(np.ones((2, 12)))
        for name, values in before.items():
            np.testing.assert_array_equal(getattr(sim, f"last_{name}"), values)
            assert np.abs(getattr(sim, name) - values).max() > 0


@pytest.mark.parametrize("engine", ENGINES)
def test_what_is_drawn_is_in_the_engine(engine: str) -> None:
    with simulator(engine, 3, domain_rand=EVERYTHING, seed=5) as sim:
        built, layout = sim.engine.built_parameters, sim.layout
        read = sim.engine.get_parameters
        near = lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-7)  # noqa: E731
        geoms, root, joints, drives = layout.geoms, [layout.root], layout.joints, layout.drives
        near(read("geom.friction", indices=geoms), sim.dr_friction_values * built("geom.friction")[geoms])
        near(read("geom.restitution", indices=geoms), sim.dr_restitution_values * np.ones(len(geoms)))
        mass = built("body.mass")[layout.root]
        near(read("body.mass", indices=root), mass + sim.dr_added_base_mass)
        factor = 1 + sim.dr_added_base_mass / mass
        near(read("body.inertia", indices=root)[:, 0], factor * built("body.inertia")[layout.root])
        near(read("body.com", indices=root)[:, 0], built("body.com")[layout.root] + sim.dr_base_com_bias)
        near(read("joint.armature", indices=joints), sim.dr_joint_armature)
        near(read("actuator.kp", indices=drives), sim.dr_kp_scale * sim.p_gains)
        near(read("actuator.kd", indices=drives), sim.dr_kd_scale * sim.d_gains)
        for key, (least, most) in EVERYTHING.items():
            if key == "ctrl_delay":
                continue
            values = getattr(sim, f"dr_{key}_values" if key in ("friction", "restitution") else f"dr_{key}")
            assert least <= values.min() < values.max() <= most
            assert len(np.unique(values, axis=0)) == 3, "each env has its own"
        kept, gains = sim.dr_friction_values, sim.dr_kp_scale
        sim.reset_idx([2])
        np.testing.assert_array_equal(sim.dr_friction_values, kept)
        assert (sim.dr_kp_scale[2] != gains[2]).all()
        np.testing.assert_array_equal(sim.dr_kp_scale[:2], gains[:2])
        walk(sim, 2)
        assert not sim.engine.get_state().fault.any()


def test_draws_follow_from_the_seed_alone() -> None:
    found = []
    for seed, count in ((1, 2), (1, 3), (2, 2)):
        with simulator("null", count, domain_rand=EVERYTHING, seed=seed) as sim:
            sim.push_robots()
            found.append((sim.dr_friction_values[:2], sim.dr_kp_scale[:2], sim.action_delay[:2], sim.base_lin_vel[:2]))
    for a, b, c in zip(*found, strict=True):
        np.testing.assert_array_equal(a, b)
        if a.dtype == float:
            assert (a != c).any()


def test_gains_of_velocities_are_scaled_by_kp() -> None:
    control = {"control_type": "V", "stiffness": 2.0}
    with simulator("mujoco", domain_rand={"kp_scale": [0.5, 0.6]}, control=control) as sim:
        read = sim.engine.get_parameters("actuator.kd", indices=sim.layout.drives)
        np.testing.assert_allclose(read, 2.0 * sim.dr_kp_scale)


def test_an_action_acts_as_many_steps_later_as_its_env_is_late() -> None:
    with simulator("mujoco", 64, domain_rand={"ctrl_delay": [0, 3]}) as sim:
        assert set(sim.action_delay) == {0, 1, 2, 3}
        for number in range(1, 7):
            sim.step(np.full((64, 12), float(number)))
            wanted = np.maximum(number - sim.action_delay, 0)
            np.testing.assert_array_equal(sim.actions, np.repeat(wanted[:, None], 12, axis=1))
        sim.reset_idx(np.arange(64))
        sim.step(np.full((64, 12), 9.0))
        np.testing.assert_array_equal(sim.actions[:, 0], np.where(sim.action_delay == 0, 9.0, 0.0))


@pytest.mark.parametrize("engine", ONE_FIRST)
def test_a_push_of_the_robot_is_a_change_of_its_velocity(engine: str) -> None:
    with simulator(engine, 8, domain_rand={"max_push_vel_xy": 0.5}) as sim:
        walk(sim, 2)
        before, turning, rates = sim.base_lin_vel_w, sim.base_ang_vel_w, sim.dof_vel
        sim.push_robots()
        change = sim.base_lin_vel_w - before
        assert np.abs(change[:, :2]).max() <= 0.5 + 1e-6
        assert np.abs(change[:, :2]).min() > 1e-4
        assert len(np.unique(change[:, 0])) == 8
        np.testing.assert_allclose(change[:, 2], 0.0, atol=1e-6)
        np.testing.assert_allclose(sim.base_ang_vel_w, turning, atol=1e-5)
        np.testing.assert_allclose(sim.dof_vel, rates, atol=1e-5)


@pytest.mark.parametrize("engine", ONE_FIRST)
def test_a_push_of_a_link_lasts_its_steps(engine: str) -> None:
    """In free fall, so that momentum tells the force; along x and y gravity says nothing."""
    push = {"max_push_force": 40.0, "push_links": ["trunk_or_base"], "push_steps": 2}
    place = {"position": [0.0, 0.0, 3.0]}
    with pytest.raises(AnysimError, match=r"push_links: no link's name holds 'trunk_or_base' \(links: base"):
        simulator(engine, 1, domain_rand=push, init_state=place)
    with simulator(engine, 3, domain_rand={**push, "push_links": ["base"]}, init_state=place) as sim:
        bodies = range(sim.layout.bodies.start, sim.layout.bodies.stop)
        mass = np.array([sim.engine.world.bodies[b].inertial.mass for b in bodies])
        arms = np.array([sim.engine.world.bodies[b].inertial.com for b in bodies])

        def momentum() -> np.ndarray:
            from anysim.math import pose as P

            state = sim.engine.get_state()
            pose, twist = state.body_pose[:, bodies], state.body_twist[:, bodies]
            speed = twist[..., :3] + P.cross(twist[..., 3:], P.rotate(pose[..., 3:], arms))
            return (mass[:, None] * speed).sum(axis=1)

        values = [momentum()]
        sim.push_links()
        for _ in range(4):
            sim.step(np.zeros((3, 12)))
            values.append(momentum())
        force = np.diff(values, axis=0)[..., :2] / sim.dt
        assert np.abs(force[0]).min() > 0.1
        assert np.abs(force[0]).max() < 40.5
        np.testing.assert_allclose(force[1], force[0], atol=0.15)
        np.testing.assert_allclose(force[2:], 0.0, atol=0.15)
