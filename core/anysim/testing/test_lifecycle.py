"""Lifecycle: build a world, reset it to its initial state, destroy it."""

import numpy as np
import pytest

from anysim.engine.capability import Capabilities, Capability
from anysim.engine.parameters import PARAMETERS
from anysim.engine.requirements import needs_of
from anysim.engine.state import Availability
from anysim.errors import CapabilityError, EngineError
from anysim.model.world import World
from anysim.testing import plugin, tolerances, worlds
from anysim.testing.compare import assert_close, assert_same, play, quaternions_apart, read, spread, tape
from anysim.testing.fixtures import skip_without


def test_availability_is_a_plain_answer(engine_class):
    """`availability()` says whether and which version; it needs no instance."""
    here = engine_class.availability()
    assert isinstance(here, Availability)
    assert here.available is True
    assert here.version


def test_declares_what_it_can_do(engine_class):
    """Name, capabilities and parameters are class attributes; an approximation says how good it is."""
    assert isinstance(engine_class.name, str)
    assert isinstance(engine_class.capabilities, Capabilities)
    for capability, support in engine_class.capabilities.supported.items():
        assert isinstance(capability, Capability)
        assert support.exact or support.note, f"'{capability}' is approximate, but no note says how"
    assert engine_class.parameters <= set(PARAMETERS)
    assert bool(engine_class.parameters) == (Capability.PARAMETERS_PER_ENV in engine_class.capabilities)


def test_create_world_begins_in_the_initial_state(build):
    """After `create_world` every env is in the World's initial state at time 0, at rest."""
    world = worlds.tree()
    engine = build(world, 3)
    state = engine.get_state()
    assert engine.num_envs == 3
    assert engine.world is world
    assert np.array_equal(state.time, np.zeros(3))
    pose = np.broadcast_to(world.initial_body_pose, state.body_pose.shape)
    assert_close(state.body_pose[..., :3], pose[..., :3], tolerances.KINEMATICS, "initial positions")
    assert quaternions_apart(state.body_pose[..., 3:], pose[..., 3:]) <= tolerances.KINEMATICS
    assert_close(state.joint_pos, np.array([j.initial for j in world.joints]), tolerances.READ_BACK, "initial joints")
    assert not state.body_twist.any()
    assert not state.joint_vel.any()
    assert not state.fault.any()


@pytest.mark.parametrize("world", [worlds.falling_ball, worlds.spinning_ball], ids=lambda w: w.__name__)
def test_the_simplest_worlds_are_not_refused(new_engine, engine_class, world):
    """Whatever `refusals` says of others: one ball that touches nothing is what every engine of bodies can build."""
    if not {need.capability for need in needs_of(world())} <= set(engine_class.capabilities):
        skip_without(engine_class, Capability.RIGID_BODIES)
        skip_without(engine_class, Capability.CONTACTS_STATIC)
    engine = new_engine()
    assert not list(engine.refusals(world(), engine.options))
    engine.create_world(world()).step()


def test_one_world_per_engine(build):
    """A second `create_world` is an error, and the first world goes on."""
    engine = build(worlds.scene())
    before = read(engine)
    with pytest.raises(EngineError, match="has a world already"):
        engine.create_world(worlds.scene())
    assert_same(read(engine), before, "after the refused call")
    engine.step()


def test_create_world_returns_the_engine(new_engine):
    """`create_world` returns the engine, so that it can be chained."""
    engine = new_engine()
    assert engine.create_world(World()) is engine


@pytest.mark.parametrize("world", [World(name="nothing"), World(name="tables")], ids=["no-bodies", "one-table"])
def test_worlds_in_which_nothing_moves(build, world):
    """A world without bodies, or without any that move, can be built, stepped and read."""
    if world.name == "tables":
        from anysim.model.world import Box
        from anysim.testing.sketch import Sketch

        sketch = Sketch("tables")
        sketch.fixed("table", Box((0.1, 0.1, 0.1)), (0.0, 0.0, 0.5))
        world = sketch.world()
    engine = build(world, 2)
    before = read(engine)
    engine.step(3)
    after = read(engine)
    assert after["body_pose"].shape == (2, len(world.bodies), 7)
    assert after["joint_pos"].shape == (2, 0)
    assert_same({"body_pose": after["body_pose"]}, {"body_pose": before["body_pose"]}, "a world at rest")


def test_needs_are_checked_before_the_build(engine_class, pytestconfig):
    """A world that needs what the engine does not declare is refused by name; the engine can still take another."""
    declared = engine_class.capabilities.supported
    less = Capabilities({c: support for c, support in declared.items() if c is not Capability.ARTICULATIONS})
    lesser = type("Lesser", (engine_class,), {"capabilities": less})
    with lesser(**plugin.engine_options(pytestconfig)) as engine:
        with pytest.raises(CapabilityError, match=r"body 'rail\.carriage' is a link \(articulations\)"):
            engine.create_world(worlds.slider())
        engine.create_world(World())
        engine.step()


def test_approximations_are_listed(engine_class, build):
    """After the build `approximations` holds exactly the needs that are met approximately."""
    world = worlds.scene()
    engine = build(world)
    supported = engine_class.capabilities.supported
    assert engine.approximations == [n for n in needs_of(world) if not supported[n.capability].exact]


def test_reset_leaves_nothing_over(build):
    """After `reset` an env is like a new one: equal state, and an equal future."""
    world = worlds.scene()
    used, fresh = build(world, 2), build(world, 2)
    spread(used)
    play(used, tape(world, [5, 6], 20))
    used.reset()
    assert_same(read(used), read(fresh), "after reset")
    targets = tape(world, [0, 1], 40)
    play(used, targets)
    play(fresh, targets)
    assert_same(read(used), read(fresh), "after reset and 80 steps")


def test_reset_returns_commands(build):
    """`reset` returns the drives to holding the initial position, in the World's modes."""
    world = worlds.scene()
    used, fresh = build(world), build(world)
    used.set_control(position=[1.0, 1.0], velocity=[0.3, 0.3], effort=[1.0, -1.0])
    used.set_control_mode("velocity", actuators=[0]) if Capability.CONTROL_VELOCITY in used.capabilities else None
    used.reset()
    used.step(50)
    fresh.step(50)
    assert_same(read(used), read(fresh), "drives after reset")


def test_reset_puts_fixed_bodies_back(build):
    """`reset` puts fixed bodies that were placed anew back as well."""
    engine = build(worlds.scene())
    before = read(engine)
    table = engine.index.body("table")
    engine.set_body_state(pose=[0.3, 0.4, 0.5, 0.0, 0.0, 0.0, 1.0], bodies=[table])
    assert_close(engine.get_state().body_pose[0, table, :3], np.array([0.3, 0.4, 0.5]), tolerances.READ_BACK, "placed")
    engine.reset()
    assert_same(read(engine), before, "after reset")


def test_two_engines_do_not_meet(build):
    """Two engines in one process do not disturb each other, neither by their worlds nor by their commands."""
    world = worlds.scene()
    targets = tape(world, [0], 30)
    alone = build(world)
    play(alone, targets)
    wanted = read(alone)
    alone.destroy()
    one, twin, other = build(world), build(world), build(worlds.tree(gravity=(0.0, 0.0, -3.0)))
    for target in targets:
        one.set_control(position=target)
        one.step()
        twin.set_control(position=-target)
        twin.step()
        other.step()
        one.step()
    assert_same(read(one), wanted, "beside two other engines")
    other.destroy()
    one.step()


def test_destroy_is_idempotent(build):
    """`destroy` may be called again; what was read stays."""
    engine = build(worlds.scene())
    pose = engine.get_state().body_pose
    kept = pose.copy()
    engine.destroy()
    engine.destroy()
    assert np.array_equal(pose, kept)


def test_destroy_without_a_world(new_engine):
    """`destroy` before any `create_world` is no error."""
    engine = new_engine()
    engine.destroy()
    engine.destroy()


@pytest.mark.parametrize("call", ["step", "reset", "get_state", "snapshot", "set_control", "create_world"])
def test_a_destroyed_engine_refuses(build, call):
    """After `destroy` every call but `destroy` raises and says so."""
    engine = build(World())
    engine.destroy()
    with pytest.raises(EngineError, match="was destroyed"):
        getattr(engine, call)(*([World()] if call == "create_world" else []))


def test_without_a_world_it_refuses(new_engine):
    """Before `create_world` calls raise and name it."""
    with pytest.raises(EngineError, match=r"create_world\(\)"):
        new_engine().step()


def test_context_manager_destroys(new_engine):
    """Leaving a `with` block destroys."""
    with new_engine().create_world(World()) as engine:
        engine.step()
    with pytest.raises(EngineError, match="was destroyed"):
        engine.step()
