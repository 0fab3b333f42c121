"""The drive law on a Panda: free, blocked and stiff, on every engine and between every two of them."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest

from anysim.conventions import Array
from anysim.engine.capability import Capability
from anysim.engine.conditioning import UnstableGainsWarning
from anysim.engine.factory import create_simulation, runnable
from anysim.model.world import Actuation, Actuator, World
from anysim.testing import tolerances
from tests.parity.pressing import Press, arm_joint, fingers, panda

ENGINES = runnable(Capability.DYNAMICS)

pytestmark = pytest.mark.skipif(len(ENGINES) < 2, reason="fewer than two engines with dynamics are installed")


# ---------------------------------------------------------------------- free


def tape(world: World) -> tuple[Array, Array]:
    """Position targets (T, A) that go to four places in half a second each and rest there; where it rests (T,) bool."""
    rng = np.random.default_rng(7)
    start = np.array([world.joints[a.joint].initial for a in world.actuators])
    spread = np.array([0.3 if "finger" not in a.name else 0.0 for a in world.actuators])
    rows, resting = [], []
    here = start
    for number in range(4):
        there = start + spread * rng.uniform(-1.0, 1.0, len(start))
        there[spread == 0] = 0.04 if number % 2 else 0.02
        for share in np.linspace(0.0, 1.0, 25):
            rows.append(here + share * (there - here))
        rows += [there] * 50
        resting += [False] * 74 + [True]
        here = there
    return np.array(rows), np.array(resting)


@cache
def played(engine: str, actuation: Actuation) -> Array:
    """Joint positions (T, J) after each row of the tape."""
    world = panda(actuation)
    with create_simulation(engine).create_world(world) as simulation:
        track = []
        for target in tape(world)[0]:
            simulation.set_control(position=target[None])
            simulation.step(world.physics.substeps)
            track.append(simulation.get_state().joint_pos[0].copy())
        return np.array(track)


@pytest.mark.slow
@pytest.mark.parametrize("pair", list(combinations(ENGINES, 2)), ids="-".join)
def test_a_free_tape_is_the_same_everywhere(pair: tuple[str, str]) -> None:
    """Within 5e-3 rad on the way and 1e-3 rad at rest, and the arm really moved."""
    first, second = (played(name, Actuation.IMPLICIT_PD) for name in pair)
    targets, resting = tape(panda())
    gap = np.abs(first - second)
    assert np.ptp(first, axis=0)[:7].min() > 0.1
    assert np.abs(first[resting][:, :7] - targets[resting][:, :7]).max() < 0.02
    assert gap.max() < tolerances.TRANSIENT
    assert gap[resting].max() < tolerances.AT_REST


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_native_drives_stay_near_the_law(engine: str) -> None:
    """As near as each engine declares: 5e-3 rad on the way, 1e-3 at rest, against its own law."""
    gap = np.abs(played(engine, Actuation.NATIVE) - played(engine, Actuation.IMPLICIT_PD))
    assert gap.max() < tolerances.TRANSIENT
    assert gap[tape(panda())[1]].max() < tolerances.AT_REST


# ---------------------------------------------------------------------- blocked


def pressed(engine: str, press: Press, share: float, first: float) -> tuple[Array, Array]:
    """The law's efforts (K,) and those that the contact shows, for `share` of the effort limit asked for.

    The drives first go by `first` [rad or m] until they touch, so that the second target is so far behind the contact.
    """
    world, numbers = press.world, list(press.actuators)
    drives: Sequence[Actuator] = [world.actuators[n] for n in numbers]
    joints = [drive.joint for drive in drives]
    kp, limit = np.array([d.kp for d in drives]), np.array([d.effort_limit for d in drives])
    with create_simulation(engine).create_world(world) as simulation:
        target = np.array([world.joints[a.joint].initial for a in world.actuators])
        target[numbers] += press.sense * first
        simulation.set_control(position=target[None])
        simulation.step(500)
        target[numbers] = simulation.get_state().joint_pos[0, joints] + press.sense * share * limit / kp
        simulation.set_control(position=target[None])
        simulation.step(500)
        law = kp * (target[numbers] - simulation.get_state().joint_pos[0, joints])
        return np.clip(law, -limit, limit), press.efforts(simulation)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.5, 2.0], ids=["unclipped", "clipped"])
@pytest.mark.parametrize("joint", range(7))
@pytest.mark.parametrize("engine", ENGINES)
def test_a_blocked_joint_exerts_its_torque(engine: str, joint: int, share: float) -> None:
    """Each joint of the arm, pressed against a block: the contact's moment is the commanded, clipped torque."""
    wanted, got = pressed(engine, arm_joint(joint), share, 0.1)
    limit = panda().actuators[joint].effort_limit
    if share > 1:
        assert wanted[0] == limit
    else:
        assert 0.4 * limit < wanted[0] < 0.95 * limit
    assert np.abs(got / wanted - 1).max() < tolerances.BLOCKED


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.5, 2.0], ids=["unclipped", "clipped"])
@pytest.mark.parametrize("engine", ENGINES)
def test_blocked_fingers_exert_their_force(engine: str, share: float) -> None:
    """Both fingers, each on its side of a block: 20 N as asked for, 40 N where the limit clips 80."""
    wanted, got = pressed(engine, fingers(), share, 0.02)
    assert wanted == pytest.approx([-40.0] * 2 if share > 1 else [-20.0] * 2, rel=0.05)
    assert np.abs(got / wanted - 1).max() < tolerances.BLOCKED


# ---------------------------------------------------------------------- stiff

STIFF = ((4500.0, 450.0), (4500.0, 450.0), (3500.0, 350.0), (3500.0, 350.0), *[(2000.0, 200.0)] * 3)
"""Gains (kp, kd) as stiff as any that are used with this arm."""


def stiff(dt: float, actuation: Actuation = Actuation.IMPLICIT_PD) -> World:
    """The Panda with stiff gains, and without the rotor inertia that would calm its wrist."""
    world = panda(actuation, dt)
    gains = [*STIFF, *((a.kp, a.kd) for a in world.actuators[7:])]
    return replace(
        world,
        actuators=tuple(replace(a, kp=kp, kd=kd) for a, (kp, kd) in zip(world.actuators, gains, strict=True)),
        joints=tuple(replace(j, armature=0.0) if i < 7 else j for i, j in enumerate(world.joints)),
    )


@pytest.mark.slow
@pytest.mark.parametrize("dt", [0.002, 1 / 240], ids=["2ms", "240Hz"])
@pytest.mark.parametrize("engine", ENGINES)
def test_stiff_gains_settle(engine: str, dt: float) -> None:
    """One second after a step of 0.2 rad in every joint the arm is there and still."""
    world = stiff(dt)
    with create_simulation(engine).create_world(world) as simulation:
        target = np.array([world.joints[a.joint].initial for a in world.actuators])
        target[:7] += 0.2
        simulation.set_control(position=target[None])
        simulation.step(round(1.0 / dt))
        state = simulation.get_state()
        assert np.abs(state.joint_pos[0, :7] - target[:7]).max() < tolerances.AT_REST
        assert np.abs(state.joint_vel[0, :7]).max() < 2e-3


@pytest.mark.parametrize("engine", ENGINES[:1])
def test_explicit_drives_that_are_too_stiff_are_warned_of(engine: str) -> None:
    """The same gains under the explicit law: a warning at the build, with the number and the remedy."""
    with (
        pytest.warns(UnstableGainsWarning, match="implicit_pd"),
        create_simulation(engine).create_world(stiff(0.002, Actuation.EXPLICIT_PD)),
    ):
        pass
