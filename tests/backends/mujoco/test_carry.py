"""After a live edit the rest goes on as if nothing had happened."""

import numpy as np
import pytest

from anysim.model.world import Body, BodyKind, Box, Geom

HALF = (0.1, 0.1, 0.1)


def _extended(worlds, kind, position):
    body = Body("new", kind, position=position, inertial=worlds.box_inertial(5.0, HALF))
    return worlds.with_body(worlds.scene(), body, Geom("new", 0, Box(HALF)))


def _shared(engine) -> np.ndarray:
    """The state of what is in the plain scene, by name."""
    state = engine.get_state()
    bodies = [engine.index.body(name) for name in ("ball", "box", "base", "upper", "lower")]
    fields = (
        state.joint_pos,
        state.joint_vel,
        state.joint_effort,
        state.contact_force,
        state.body_pose[:, bodies],
        state.body_twist[:, bodies],
    )
    return np.concatenate([np.reshape(f, (engine.num_envs, -1)) for f in fields], axis=1)


@pytest.mark.parametrize(
    ("kind", "position", "options"),
    [
        ("static", (20.0, 0.0, 0.0), {}),
        ("static", (20.0, 0.0, 0.0), {"jacobian": "sparse"}),
        ("free", (20.0, 0.0, 100.0), {"jacobian": "sparse"}),
    ],
)
def test_others_go_on_bit_for_bit(worlds, make, shake, kind, position, options):
    """An object far away appears and leaves again, 200 control steps each, beside an engine that saw none of it."""
    engine, alone = make(worlds.scene(), 2, **options), make(worlds.scene(), 2, **options)
    for e in (engine, alone):
        e.set_parameters("body.inertia", [[[0.011, 0.012, 0.013, 0.001, -0.002, 0.0005]]], [1], [1])
        e.set_parameters("joint.damping", [[0.3, 0.2]], [1])
        e.set_body_state([[[0.5, 1.0, 0.6, 0.0, 0.0, 0.0, 1.0]]], env_ids=[0], bodies=[2])
        shake(e, seed=1)
    for world in (_extended(worlds, BodyKind(kind), position), worlds.scene()):
        engine._rebuild(world)
        assert np.array_equal(_shared(engine), _shared(alone))
        for seed in range(200):
            for e in (engine, alone):
                shake(e, 1, seed=seed)
            assert np.array_equal(_shared(engine), _shared(alone)), f"control step {seed}"


def test_a_free_object_changes_no_more_than_rounding(worlds, make, shake):
    """With MuJoCo's own choice of a dense Jacobian, sums over more dofs are rounded differently."""
    engine, alone = make(worlds.scene()), make(worlds.scene())
    for e in (engine, alone):
        shake(e, seed=1)
    engine._rebuild(_extended(worlds, BodyKind.FREE, (20.0, 0.0, 0.1)))
    assert np.array_equal(_shared(engine), _shared(alone))
    for seed in range(20):
        for e in (engine, alone):
            shake(e, 1, seed=seed)
    assert np.allclose(_shared(engine), _shared(alone), atol=1e-6)


def test_faults_and_clocks_are_carried(worlds, make):
    """A diverged env does not heal by an edit."""
    engine = make(worlds.scene(), 2)
    engine.set_body_state(twist=np.full((1, 2, 6), 1e12), env_ids=[1])
    engine.step(10)
    engine._rebuild(_extended(worlds, BodyKind.STATIC, (20.0, 0.0, 0.0)))
    state = engine.get_state()
    assert state.fault.tolist() == [False, True]
    assert np.allclose(state.time, 0.02)
