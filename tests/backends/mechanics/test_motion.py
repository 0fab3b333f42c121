"""Mass matrix, drive law, twists and momentum of trees, against core's own mechanics and against Newton's law."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.engine.control import Control
from anysim.kinematics.dynamics import frame_jacobians, mass_matrix
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import Actuation, BodyKind, Inertial
from anysim.testing import worlds
from anysim_mechanics import articulation as K
from anysim_mechanics.computed_drives import DriveArrays, TreeDrives
from anysim_mechanics.damped_drives import DampedDrives, native_targets, substep
from anysim_mechanics.link_twists import LinkTwists
from anysim_mechanics.momentum_balance import Circumstances, MomentumBalance, Substep
from anysim_mechanics.trees import frames_of, trees_of


def _moving_tree(free):
    """A tree of mixed joints on a base that is fixed or free, with a pose and a motion of its own."""
    world = worlds.tree((0.0, 0.0, -9.81))
    base = next(i for i, body in enumerate(world.bodies) if body.name.endswith("base"))
    if free:
        own = Inertial(2.0, (0.05, 0.0, 0.02), (0.1, 0.2, 0.15, 0.01, 0.0, 0.02))
        bodies = list(world.bodies)
        bodies[base] = replace(bodies[base], kind=BodyKind.FREE, inertial=own)
        world = replace(world, bodies=tuple(bodies))
    rng = np.random.default_rng(3)
    position, velocity = rng.uniform(-0.4, 0.4, len(world.joints)), rng.standard_normal(len(world.joints))
    roots = np.array([[*body.position, *body.quaternion] for body in world.bodies])
    return world, base, forward_kinematics(world, roots[None], position[None])[0], position, velocity


@pytest.mark.parametrize("free", [False, True], ids=["fixed-base", "free-base"])
def test_the_mass_matrix_is_cores(free):
    world, base, poses, position, velocity = _moving_tree(free)
    tree = next(tree for tree in trees_of(world, frames_of(world)) if tree.bodies[0] == base)
    arrays = DriveArrays(world, frames_of(world), [tree], 1)
    mass, bias, known = np.empty((tree.size, tree.size)), np.empty(tree.size), np.empty(tree.size)
    motion, wrench = np.stack([position, velocity])[:, tree.joints], np.zeros((len(tree.bodies), 6))
    root = np.concatenate([poses[base], np.zeros(6)])
    terms = tree.joint_ints, tree.joint_floats, arrays.bodies[0, tree.bodies], wrench, arrays.gravity[0], root, motion
    K.dynamics(*terms, tree.first, mass, bias, known)
    whole = mass_matrix(world, poses, tree.bodies.tolist())
    order = np.roll(np.arange(tree.size), tree.first)  # core has the joints first, then the free root
    assert np.allclose(mass, whole[np.ix_(order, order)], rtol=1e-12, atol=1e-14)
    assert not known.any()
    K.dynamics(*terms[:6], np.stack([position, 0 * velocity])[:, tree.joints], tree.first, mass, bias, known)
    weight = np.array([body.inertial.mass for body in world.bodies])[tree.bodies] * 9.81
    height = frame_jacobians(world, poses, tree.bodies.tolist())
    coms = np.array([P.rotate(poses[b, 3:], np.array(world.bodies[b].inertial.com)) for b in tree.bodies])
    rising = height[:, 2] + np.cross(height[:, 3:], coms[:, :, None], axis=1)[:, 2]
    assert np.allclose(bias, (weight @ rising)[order], rtol=1e-12, atol=1e-12)


def test_a_drive_accelerates_its_joint_by_newtons_law():
    """Without damping the torque is the command, and it is cut at the effort limit."""
    world = worlds.scene()
    tree = next(tree for tree in trees_of(world, frames_of(world)) if len(tree.joints))
    arrays = DriveArrays(world, frames_of(world), [tree], 2)
    arrays.gains.kd[...] = 0.0
    drives = len(world.actuators)
    none = np.zeros((2, drives))
    feed = np.full((2, drives), 7.0)
    arrays.command(Control(none, none, feed, np.full((2, drives), 2, dtype=np.int8)))
    law = TreeDrives(arrays, 1, tree, None, world.physics.dt)
    assert law.solve()
    assert law.effort == pytest.approx(np.full(drives, 7.0), abs=1e-12)
    arrays.command(Control(none, none, 100.0 * feed, np.full((2, drives), 2, dtype=np.int8)))
    law = TreeDrives(arrays, 0, tree, None, world.physics.dt)
    assert law.solve()
    assert law.effort == pytest.approx(arrays.gains.limit[0])
    law.motion[0, 0] = np.nan
    assert not law.solve()


@pytest.mark.parametrize("free", [False, True], ids=["fixed-base", "free-base"])
def test_twists_are_those_of_the_jacobians(free):
    world, base, poses, _, rates = _moving_tree(free)
    com = np.array([body.inertial.com for body in world.bodies])
    roots = [i for i, body in enumerate(world.bodies) if body.kind is BodyKind.FREE]
    twists = np.random.default_rng(5).standard_normal((len(roots), 6))
    velocity = np.zeros((len(world.bodies), 6))
    velocity[roots] = twists
    velocity[roots, :3] += P.cross(twists[:, 3:], P.rotate(poses[roots, 3:], com[roots]))
    found = LinkTwists(world).of(poses[None], velocity[None], rates[None], com[None])[0]
    wanted = frame_jacobians(world, poses) @ np.concatenate([rates, twists.ravel()])
    assert np.allclose(found, wanted, rtol=1e-12, atol=1e-12)
    assert found[base].any() == free


def test_what_is_left_of_momentum_is_the_contact():
    """A box in free fall with a push feels nothing; one that keeps its speed is carried by its weight and the push."""
    world = worlds.scene()
    box = next(i for i, body in enumerate(world.bodies) if body.name == "box")
    count, dt, push = len(world.bodies), world.physics.dt, np.array([3.0, 0.0, -2.0])
    mass = np.array([body.inertial.mass for body in world.bodies])
    slowing = np.zeros((count, 2))
    slowing[box, 0] = 0.5
    given = Circumstances(
        np.array([0.0, 0.0, -9.81]), mass, np.zeros(len(world.joints)), slowing, np.array([[box, *push, 0, 0, 0]])
    )
    rule, still = MomentumBalance(world, np.tile([0.0, 0.0, 0.0, 1.0], (len(world.joints), 1))), np.zeros((count, 3))
    turn = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
    speed, pull = np.array([1.0, 0.0, 0.0]), given.gravity + push / mass[box]
    before, after = still.copy(), still.copy()
    before[box], after[box] = speed, (speed + dt * pull) * (1.0 - 0.5 * dt)
    falling = rule.solve(Substep(before, after, turn, still), given)
    assert falling.force[box] == pytest.approx(np.zeros(3), abs=1e-9)
    held = rule.solve(Substep(still, still, turn, still), given._replace(slowing=np.zeros((count, 2))))
    assert held.force[box] == pytest.approx(-mass[box] * given.gravity - push)
    assert falling.doubt[box] == 0.0
    assert np.isinf(rule.unknown().doubt).all()


@pytest.mark.parametrize("actuation", [Actuation.IMPLICIT_PD, Actuation.EXPLICIT_PD])
def test_force_and_damping_are_the_law_together(actuation):
    """What a library is given at the state of a substep, its damping on the present speed, is kp (q* - q) - kd qd."""
    world = worlds.scene()
    world = replace(world, physics=replace(world.physics, actuation=actuation))
    joints, target = len(world.joints), np.array([[0.1, -0.2]])
    drives = DampedDrives(world, 1, np.full((1, 3, joints), np.nan))
    none = np.zeros((1, joints))
    drives.apply(Control(target, none, none, np.zeros((1, joints), dtype=np.int8)))
    position, velocity, force = (np.array(v, dtype=np.float32) for v in ([0.05, -0.1], [0.2, -0.3], [0.0, 0.0]))
    told = substep(
        drives.law, 0, np.arange(joints), position, velocity, drives.kind, 3e38, drives.told, force, drives.news, 0
    )
    assert told == joints, "a library that was told nothing must be told of every joint"
    kp, kd = drives.gains.kp[0], drives.gains.kd[0]
    own = drives.passive[0]
    law = kp * (target[0] - position) - kd * velocity
    assert force - (drives.told[0, 0] - own) * velocity == pytest.approx(law, rel=1e-6)
    assert drives.told[0, 0] == pytest.approx(own if actuation is Actuation.EXPLICIT_PD else own + kd)
    effort = np.zeros((1, joints))
    drives.note(0, lambda: (position.astype(float), velocity.astype(float)))
    drives.exerted(0, effort)
    assert effort[0] == pytest.approx(law, rel=1e-6)


def test_native_targets_make_a_drive_do_the_law():
    """kp (p - q) + whole (s - qd) is the law less the joint's own damping, with the targets p and s."""
    rng = np.random.default_rng(7)
    position, velocity, effort, q, qd, damping, passive = rng.uniform(0.1, 2.0, (7, 1, 6))
    stiffness = np.where(np.arange(6) % 2, rng.uniform(50.0, 90.0, (1, 6)), 0.0)
    place, speed = np.empty((1, 6)), np.empty((1, 6))
    native_targets(position, velocity, effort, stiffness, damping, damping + passive, place, speed)
    theirs = stiffness * (place - q) + (damping + passive) * (speed - qd)
    law = stiffness * (position - q) + damping * (velocity - qd) + effort
    assert np.allclose(theirs, law - passive * qd, rtol=1e-12)
