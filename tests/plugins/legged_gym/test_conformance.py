"""Every property on three engines, in states that were written: equal to each other and to what geometry says."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from anysim.math import pose as P
from anysim.testing.errors import allowed
from anysim_legged_gym.simulator import LeggedSimulator
from tests.plugins.legged_gym.simulators import ENGINES, simulator

POSES = 1e-6
rng = np.random.default_rng(16)
BASE = rng.uniform([-1, -1, 1.5], [1, 1, 2.5], (3, 3))
# Errors of roll and yaw grow without bound as pitch nears pi / 2, and two engines keep turns in single precision.
TURN = Rotation.from_euler("xyz", rng.uniform([-3, -0.7, -3], [3, 0.7, 3], (3, 3)))
LINEAR, ANGULAR = rng.normal(size=(3, 3)), rng.normal(size=(3, 3))
JOINTS, RATES = rng.uniform([-0.3, 0.5, -1.9] * 4, [0.3, 1.0, -1.2] * 4, (3, 12)), rng.normal(size=(3, 12))
LINKS = {"terminate_after_contacts_on": ["base", "hip"], "penalize_contacts_on": ["thigh"], "key_bodies": ["trunk"]}


def written(sim: LeggedSimulator) -> None:
    every = np.arange(3)
    sim.reset_dofs(every, JOINTS, RATES)
    sim.reset_root_states(every, BASE, TURN.as_quat(), LINEAR, ANGULAR)


def turned(axis: str, angle: np.ndarray, place: np.ndarray) -> np.ndarray:
    return Rotation.from_euler(axis, angle[:, None]).apply(place)


def quantities(sim: LeggedSimulator) -> dict[str, np.ndarray]:
    names = (
        "base_pos base_quat base_euler base_lin_vel base_ang_vel base_lin_vel_w base_ang_vel_w projected_gravity "
        "dof_pos dof_vel dof_pos_limits dof_vel_limits torque_limits p_gains d_gains torques feet_pos feet_vel "
        "key_body_pos feet_indices feet_contact_indices termination_contact_indices penalized_contact_indices "
        "link_contact_forces link_contact_states measured_heights heights_around_feet terrain_types "
        "terrain_levels terrain_origins env_origins base_init_pos base_init_quat default_dof_pos actions "
        "action_delay last_actions last_dof_pos last_dof_vel last_torques last_base_lin_vel last_base_ang_vel "
        "last_feet_vel height_points dr_friction_values dr_restitution_values dr_added_base_mass dr_base_com_bias "
        "dr_joint_armature dr_kp_scale dr_kd_scale"
    )
    return {name: np.asarray(getattr(sim, name)) for name in names.split()}


@pytest.mark.parametrize("engine", ENGINES)
def test_properties_are_what_geometry_says(engine: str) -> None:
    with simulator(engine, 3, asset=LINKS) as sim:
        written(sim)
        found = quantities(sim)
        near = lambda name, wanted: np.testing.assert_allclose(found[name], wanted, atol=POSES, err_msg=name)  # noqa: E731
        near("base_pos", BASE)
        near("base_quat", (TURN.as_quat(canonical=True)))
        near("base_euler", TURN.as_euler("xyz"))
        near("base_lin_vel", TURN.inv().apply(LINEAR))
        near("base_ang_vel", TURN.inv().apply(ANGULAR))
        near("projected_gravity", TURN.inv().apply([0.0, 0.0, -1.0]))
        near("dof_pos", JOINTS)
        near("dof_vel", RATES)
        near("measured_heights", np.zeros((3, 187)))
        near("link_contact_forces", np.zeros((3, 13, 3)))
        near("torques", np.zeros((3, 12)))
        assert sim.dof_names[:3] == ("FR_hip_joint", "FR_thigh_joint", "FR_calf_joint")
        assert [sim.body_names[i] for i in sim.feet_indices] == [f"{leg}_calf" for leg in ("FL", "FR", "RL", "RR")]
        assert [sim.body_names[i] for i in sim.penalized_contact_indices] == [
            f"{leg}_thigh" for leg in ("FR", "FL", "RR", "RL")
        ]
        assert len(sim.termination_contact_indices) == 5
        # feet from the robot's own chain: hip about x, thigh and calf about y
        for foot, name in enumerate(sim.feet_names):
            columns = [sim.dof_names.index(f"{name[:2]}_{part}_joint") for part in ("hip", "thigh", "calf")]
            front, left = (1 if name[0] == "F" else -1), (1 if name[1] == "L" else -1)
            hip, thigh, calf = JOINTS[:, columns].T
            place = np.zeros((3, 3))
            for length, angle in ((0.213, calf), (0.213, thigh)):
                place = turned("y", angle, place + np.array([0.0, 0.0, -length]))
            place = turned("x", hip, place + np.array([0.0, 0.08 * left, 0.0]))
            near_place = TURN.apply(place + np.array([0.1881 * front, 0.04675 * left, 0.0])) + BASE
            np.testing.assert_allclose(found["feet_pos"][:, foot], near_place, atol=POSES)


def test_properties_are_the_same_on_every_engine() -> None:
    found = {}
    for engine in ENGINES:
        with simulator(engine, 3, asset=LINKS) as sim:
            written(sim)
            found[engine] = quantities(sim)
    for name, first in found["mujoco"].items():
        for engine in ENGINES[1:]:
            np.testing.assert_allclose(found[engine][name], first, atol=POSES, err_msg=f"{name} on {engine}")


@pytest.mark.parametrize("engine", ENGINES)
def test_velocities_of_feet_are_how_fast_their_places_change(engine: str) -> None:
    """Between two written states, a hair of time apart; engines keep places in single precision."""
    hair, places = 2e-3, []
    with simulator(engine, 3) as sim:
        written(sim)
        speed = sim.feet_vel
        for time in (-hair, hair):
            sim.reset_dofs(np.arange(3), JOINTS + time * RATES, RATES)
            turn = Rotation.from_rotvec(time * ANGULAR) * TURN
            sim.reset_root_states(np.arange(3), BASE + time * LINEAR, turn.as_quat(), LINEAR, ANGULAR)
            places.append(sim.feet_pos)
        np.testing.assert_allclose((places[1] - places[0]) / (2 * hair), speed, atol=1e-3)


@pytest.mark.parametrize("engine", ENGINES)
def test_contact_forces_carry_the_robot(engine: str) -> None:
    """At rest: their sum against the weight, and their moments about the centre of mass against none."""
    with simulator(engine, 1) as sim:
        for _ in range(130):
            sim.step(np.zeros((1, 12)))
        inertials, poses = [b.inertial for b in sim.engine.world.bodies], sim.engine.get_state().body_pose[0]
        masses = np.array([i.mass for i in inertials])
        centres = poses[:, :3] + P.rotate(poses[:, 3:], np.array([i.com for i in inertials]))
        weight = 9.81 * masses.sum()
        error = allowed(sim.engine.capabilities, "felt") * weight
        forces = sim.link_contact_forces[0]
        np.testing.assert_allclose(forces.sum(axis=0), [0.0, 0.0, weight], atol=error)
        at = sim.feet_contact_indices
        touching = sim.feet_pos[0] - [0.0, 0.0, 0.02]
        moments = np.cross(touching - masses @ centres / masses.sum(), forces[at]).sum(axis=0)
        np.testing.assert_allclose(moments, 0.0, atol=0.3 * error)  # feet stand 0.2 to 0.3 m from the centre
        others = np.setdiff1d(np.arange(sim.num_bodies), at)
        assert np.abs(forces[others]).max() == 0.0, "only feet touch the ground"
        assert sim.link_contact_states[0, at].all()
        assert not sim.link_contact_states[0, others].any()


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("kind", "scale"), [("P", 0.25), ("V", 3.0), ("T", 8.0)])
def test_torques_are_the_law(engine: str, kind: str, scale: float) -> None:
    """Of each kind of control, from the state at the beginning of the step, clipped to the limits."""
    control = {"control_type": kind, "action_scale": scale, "decimation": 1, "clip_actions": 5.0}
    if kind == "V":
        control["stiffness"] = 2.0
    draws = np.random.default_rng(3)
    with simulator(engine, 2, control=control, init_state={"position": [0.0, 0.0, 1.0]}) as sim:
        for _ in range(5):
            actions = draws.normal(scale=3.0, size=(2, 12))
            position, rate, due = sim.dof_pos, sim.dof_vel, np.clip(actions, -5.0, 5.0) * scale
            sim.step(actions)
            wanted = {
                "P": 40.0 * (sim.default_dof_pos + due - position) - 1.0 * rate,
                "V": 2.0 * (due - rate),
                "T": due,
            }[kind]
            clipped = np.clip(wanted, -sim.torque_limits, sim.torque_limits)
            np.testing.assert_allclose(sim.torques, clipped, atol=1e-4)
        assert np.abs(wanted).max() > sim.torque_limits.max() or kind == "V", "some of them were clipped"
