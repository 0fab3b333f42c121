"""Reads, rebuilds and snapshots."""

import numpy as np
import pytest

from anysim.compile.world import compile_world
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.testing import worlds
from anysim.testing.compare import play, read, spread, tape
from anysim_parity.kinematics import random_positions
from anysim_schemas.run import WorldSpec


def test_packed_poses_are_the_entities_poses(make):
    """The order and layout of SAPIEN's packed poses are not documented: they are compared with the entities' own."""
    engine = make(worlds.tree())
    spread(engine)
    engine.step(10)
    scene = engine._envs.scenes[0]
    wanted = [[*e.pose.p, *np.asarray(e.pose.q)[[1, 2, 3, 0]]] for e in scene.entities]
    assert np.array_equal(scene.poses(), np.array(wanted, dtype=float))


def test_links_are_where_their_joints_put_them_whatever_shapes_they_have(make):
    """PhysX rounds the joints' frames with each shape and inertial; stated last, they are as without shapes."""
    robot = {"source": {"asset": "example-robot-data:talos_data/robots/talos_reduced.urdf"}, "fixed": True}
    world = compile_world(WorldSpec.model_validate({"objects": {"talos": robot}}))
    engine = make(world)
    worst = np.zeros(2)
    for q in random_positions(world, 10, np.random.default_rng(0)):
        engine.set_joint_state([q])
        pose = engine.get_state().body_pose[0]
        wanted = forward_kinematics(world, world.initial_body_pose[None], q[None])[0]
        error = P.norm(pose[:, :3] - wanted[:, :3]).max(), P.angle_between(pose[:, 3:], wanted[:, 3:]).max()
        worst = np.maximum(worst, error)
    assert (worst < [7e-7, 1.4e-6]).all(), worst  # with frames stated first 1.4e-6 m and 2.5e-6 rad


def test_twists_of_links_agree_with_physx_at_rest_of_the_step(make):
    """Our sums over joints are PhysX' own velocities, where no step lies between velocity and pose."""
    engine = make(worlds.tree())
    engine.set_joint_state([[0.1, -0.2, 0.3, 0.4]], [[0.5, -0.3, 0.7, 0.2]])
    scene, twist = engine._envs.scenes[0], engine.get_state().body_twist[0]
    for tree in scene.trees:
        for body in tree.bodies[1:]:
            assert twist[body, 3:] == pytest.approx(scene.bodies[body].angular_velocity, abs=1e-5)


def test_a_rebuild_keeps_the_state(make):
    """A change of friction builds the scene anew: poses, joints and forces stay, and the other env goes on exactly."""
    engine, clean = make(worlds.scene(sensor=True), 2), make(worlds.scene(sensor=True), 2)
    for e in (engine, clean):
        spread(e)
        play(e, tape(e.world, [0, 1], 30))
    before = read(engine)
    engine.set_parameters("geom.friction", 0.5, env_ids=[1])
    after = read(engine)
    for name in ("joint_pos", "joint_vel", "joint_effort", "contact_force", "time"):
        assert np.array_equal(after[name], before[name]), name
    for name in ("body_pose", "body_twist"):
        assert np.abs(after[name] - before[name]).max() < 1e-5, name
    for e in (engine, clean):
        e.step(20)
    assert np.array_equal(read(engine)["body_pose"][0], read(clean)["body_pose"][0])


def test_restoring_twice_is_the_same(make):
    """A snapshot comes back into a fresh scene: what follows does not depend on what was before it."""
    engine = make(worlds.scene())
    spread(engine)
    engine.step(200)
    snapshot = engine.snapshot(level="state")
    ends = []
    for steps in (1, 150):
        engine.step(steps)
        engine.restore(snapshot)
        engine.step(100)
        ends.append(read(engine)["body_pose"])
    assert np.array_equal(*ends)
