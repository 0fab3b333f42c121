"""Bit-exact: snapshots, resets, partial steps; independent of the number of envs, their order and the threads."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.engine.state import SnapshotLevel
from anysim.errors import SnapshotError


def _equal(a, b) -> bool:
    return all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))


@pytest.mark.parametrize("level", list(SnapshotLevel))
def test_a_snapshot_continues_bit_for_bit(worlds, make, shake, level):
    """In its own slots, in others, and in another engine."""
    engine = make(worlds.scene(), 3)
    shake(engine, seed=1)
    snapshot, effort = engine.snapshot([1], level), engine.get_state().joint_effort
    wanted = [rows[1] for rows in shake(engine, seed=2)]
    engine.restore(snapshot, [1])
    assert np.array_equal(engine.get_state().joint_effort[1], effort[1])
    assert _equal([rows[1] for rows in shake(engine, seed=2)], wanted)
    other = make(worlds.scene(), 2, threads=1)
    shake(other, seed=3)
    other.restore(snapshot, [1])
    assert _equal([rows[1] for rows in shake(other, seed=2)], wanted)


def test_a_snapshot_brings_its_parameters_along(worlds, make, shake):
    """Inertias too, whose principal axes must come back with the same bits."""
    engine = make(worlds.scene(), 2)
    engine.set_parameters("body.inertia", [[[0.011, 0.012, 0.013, 0.001, -0.002, 0.0005]]], [0], [1])
    engine.set_parameters("body.mass", [[1.3]], [0], [1])
    engine.set_parameters("actuator.kp", [[80.0, 70.0]], [0])
    engine.set_control_mode("velocity", [0], [1])
    shake(engine, seed=1)
    snapshot = engine.snapshot([0])
    wanted = [rows[0] for rows in shake(engine, seed=2)]
    engine.set_parameters("body.inertia", [[[0.02, 0.02, 0.02, 0.0, 0.001, 0.0]]], [0], [1])
    engine.set_parameters("joint.damping", [[3.0, 3.0]], [0])
    engine.restore(snapshot, [0])
    assert _equal([rows[0] for rows in shake(engine, seed=2)], wanted)
    fresh = make(worlds.scene(), 3)
    fresh.restore(snapshot, [2])
    assert _equal([rows[2] for rows in shake(fresh, seed=2)], wanted)


def test_a_snapshot_without_parameters_undoes_them(worlds, make, shake):
    """Taken before anything was changed, restored after."""
    engine = make(worlds.scene(), 2)
    shake(engine, seed=1)
    snapshot = engine.snapshot([0])
    wanted = [rows[0] for rows in shake(engine, seed=2)]
    for name, value in (
        ("body.inertia", [[[0.02, 0.02, 0.02, 0.0, 0.001, 0.0]]]),
        ("body.mass", [[3.0]]),
        ("body.com", [[[0.0, 0.1, 0.0]]]),
    ):
        engine.set_parameters(name, value, [0], [1])
    engine.restore(snapshot, [0])
    assert _equal([rows[0] for rows in shake(engine, seed=2)], wanted)


def test_a_snapshot_keeps_the_fault(worlds, make):
    """An env that diverged is one after a restore, too; a healthy one heals."""
    engine = make(worlds.ball(), 2)
    healthy = engine.snapshot([0])
    engine.set_body_state(twist=np.full((1, 1, 6), 1e12), env_ids=[0])
    engine.step(5)
    broken = engine.snapshot([0])
    engine.restore(healthy, [0])
    assert not engine.get_state().fault.any()
    engine.restore(broken, [1])
    assert engine.get_state().fault.tolist() == [False, True]


def test_other_solver_settings_are_another_engine(worlds, make):
    """A snapshot would not continue bit for bit under them, and says so."""
    snapshot = make(worlds.ball(), solver="cg").snapshot()
    with pytest.raises(SnapshotError, match=r"solver=cg"):
        make(worlds.ball()).restore(snapshot)
    make(worlds.ball(), solver="cg", threads=1, shadows=True).restore(snapshot)


def test_a_reset_env_is_a_new_one(worlds, make, shake):
    """Whatever happened before, warm start and clock included."""
    engine = make(worlds.scene(), 3)
    shake(engine, seed=1)
    engine.set_body_state(np.tile([0.3, 0.3, 0.3, 0.0, 0.0, 0.0, 1.0], (3, 2, 1)))
    engine.reset([0, 2])
    assert engine.get_state().time.tolist()[0] == 0.0
    wanted = shake(make(worlds.scene(), 1), seed=2)
    for rows, one in zip(shake(engine, seed=2), wanted, strict=True):
        assert np.array_equal(rows[0], one[0])
        assert np.array_equal(rows[2], one[0])


def test_envs_do_not_depend_on_number_or_threads(worlds, make, shake):
    """1, 2 and 7 envs; 1, 2 and 3 threads."""
    wanted = [rows[0] for rows in shake(make(worlds.scene(), 1))]
    for num_envs, threads in ((2, 1), (7, 2), (7, 3), (7, 0)):
        for rows, one in zip(shake(make(worlds.scene(), num_envs, threads=threads)), wanted, strict=True):
            assert all(np.array_equal(row, one) for row in rows)


def test_partial_steps_leave_the_others_alone(worlds, make, shake):
    """Ids in any order; the stepped ones go as if alone, the others do not move."""
    engine = make(worlds.scene(), 4)
    shake(engine, 5, seed=1)
    reference = make(worlds.scene(), 1)
    shake(reference, 5, seed=1)
    before = engine.get_state()
    kept = [
        getattr(before, name).copy()
        for name in ("body_pose", "body_twist", "joint_vel", "joint_effort", "contact_force")
    ]
    stepped = shake(engine, 10, seed=2, ids=[3, 1])
    for rows, one in zip(stepped, shake(reference, 10, seed=2), strict=True):
        assert np.array_equal(rows[0], one[0])
        assert np.array_equal(rows[1], one[0])
    after = engine.get_state()
    for name, value in zip(
        ("body_pose", "body_twist", "joint_vel", "joint_effort", "contact_force"), kept, strict=True
    ):
        assert np.array_equal(getattr(after, name)[[0, 2]], value[[0, 2]])
    assert np.allclose(after.time, [0.05, 0.15, 0.05, 0.15])


def test_many_small_steps_are_one_big_one(worlds, make):
    """The chunks in which an engine is stepped leave no trace."""
    one, many = make(worlds.scene()), make(worlds.scene())
    one.step(60)
    for _ in range(60):
        many.step()
        _ = many.get_state().body_twist
    for name in ("body_pose", "body_twist", "joint_effort", "contact_force"):
        assert np.array_equal(getattr(one.get_state(), name), getattr(many.get_state(), name))


def test_a_rebuilt_world_is_the_same(worlds, make, shake):
    """The same World built twice has equal bits, whatever its name's hash seed."""
    assert _equal(shake(make(worlds.scene())), shake(make(replace(worlds.scene()))))
