"""Reads, rebuilds and snapshots."""

import numpy as np
import pytest

from anysim.errors import CapabilityError
from anysim.testing import worlds
from anysim.testing.compare import play, read, spread, tape


def test_packed_poses_are_the_entities_poses(make):
    """The order and layout of SAPIEN's packed poses are not documented: they are compared with the entities' own."""
    engine = make(worlds.tree())
    spread(engine)
    engine.step(10)
    scene = engine._scenes[0]
    wanted = [[*e.pose.p, *np.asarray(e.pose.q)[[1, 2, 3, 0]]] for e in scene.entities]
    assert np.array_equal(scene.poses(), np.array(wanted, dtype=float))


def test_twists_of_links_agree_with_physx_at_rest_of_the_step(make):
    """Our sums over joints are PhysX' own velocities, where no step lies between velocity and pose."""
    engine = make(worlds.tree())
    engine.set_joint_state([[0.1, -0.2, 0.3, 0.4]], [[0.5, -0.3, 0.7, 0.2]])
    scene, twist = engine._scenes[0], engine.get_state().body_twist[0]
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


def test_exact_snapshots_are_not_claimed(make):
    """PhysX keeps contact memory that nothing reads out, so continuing is close and not exact."""
    engine = make(worlds.scene())
    with pytest.raises(CapabilityError, match="snapshot: trajectory"):
        engine.snapshot()
