"""WorldState: read on one engine, written into another, or into another world that shares names."""

import numpy as np
import pytest

import anysim
from anysim.engine.base import SimEngine
from anysim.engine.snapshots.world_state import WorldState
from anysim.errors import SnapshotError
from anysim.testing import worlds
from anysim.testing.kinematic import NullEngine
from tests.runtime import light

CLOSE = 1e-6
"""SAPIEN and the poses of PyBullet are single precision: 1e-7 of metres, radians and their rates."""
READ = ("body_pose", "body_twist", "joint_pos", "joint_vel", "control_position", "control_velocity", "control_effort")


def moving(engine: str, steps: int = 6, spec: str = "slide"):
    env = light.make(engine, 2, light.SPECS[spec])
    env.reset(seed=3)
    for step in range(steps):
        env.step(np.full((2, 2), 0.4 if step % 2 else 0.9))
    return env


def gaps(a: WorldState, b: WorldState) -> dict[str, float]:
    found = {name: float(np.abs(getattr(a, name) - getattr(b, name)).max(initial=0.0)) for name in READ}
    return found | {f: float(np.abs(a.parameters[f].values - b.parameters[f].values).max()) for f in a.parameters}


def test_files_and_json_hold_all_of_it(tmp_path) -> None:
    with moving("null") as env:
        state = env.engine.world_state()
    for again in (WorldState.load(state.save(tmp_path / "w.state")), WorldState.from_json(state.to_json())):
        assert gaps(state, again) == dict.fromkeys([*READ, *state.parameters], 0.0)
        assert (again.bodies, again.joints, again.entities) == (state.bodies, state.joints, state.entities)
        assert (again.control_mode == state.control_mode).all()
        assert (again.present == state.present).all()
        assert (again.time == state.time).all()
    assert (state.rows([1, 0]).body_pose[0] == state.body_pose[1]).all()
    for text in ("{}", "[1]", "nothing", '{"format": "anysim-world-state-1"}'):
        with pytest.raises(SnapshotError, match="JSON"):
            WorldState.from_json(text)


@pytest.mark.slow
@pytest.mark.parametrize("target", ["mujoco", "pybullet", "sapien"])
@pytest.mark.parametrize("source", ["mujoco", "sapien", "pybullet"])
@pytest.mark.parametrize("spec", ["slide", "mixed"])
def test_a_state_reads_back_on_another_engine(source, target, spec) -> None:
    """Also where other things are there than before."""
    with moving(source, spec=spec) as one, moving(target, 3, spec) as other:
        other.reset(seed=8)
        state = one.engine.world_state()
        carried = other.engine.set_world_state(state)
        assert carried == ((), ())
        back = other.engine.world_state()
        assert all(gap < CLOSE for gap in gaps(state, back).values()), gaps(state, back)
        assert np.allclose(back.time, state.time)
        assert (back.present == state.present).all()
        _goes_on_like_a_fresh_one(other.engine, state, target, spec)


def _goes_on_like_a_fresh_one(engine: SimEngine, state: WorldState, name: str, spec: str) -> None:
    """Nothing of what the engine did before is left: to the bit what a new engine comes to."""
    with light.make(name, 2, light.SPECS[spec]) as fresh:
        fresh.engine.set_world_state(state)
        for one in (engine, fresh.engine):
            one.step(10)
        for field in ("body_pose", "body_twist", "joint_pos", "joint_vel"):
            assert (getattr(engine.get_state(), field) == getattr(fresh.engine.get_state(), field)).all(), field


def test_rows_go_to_chosen_envs() -> None:
    with moving("null") as env:
        state, before = env.engine.world_state([1]), env.engine.world_state()
        env.engine.set_world_state(state, [0])
        after = env.engine.world_state()
        assert (after.body_pose[0] == before.body_pose[1]).all()
        assert (after.body_pose[1] == before.body_pose[1]).all()
        with pytest.raises(SnapshotError, match="holds 1 envs, 2 were asked for"):
            env.engine.set_world_state(state)


def test_worlds_that_share_names() -> None:
    """Refused unless asked for; then what both have is carried over, and the rest stays."""
    with moving("null") as env, anysim.create_simulation("null") as other:
        world = anysim.compile_world(
            {
                "world": {
                    "objects": {"block": {"source": {"box": [0.1, 0.1, 0.1]}}, "lamp": {"source": {"sphere": 0.1}}},
                    "layout": {"block": {"position": [0, 0, 1]}, "lamp": {"position": [0, 0, 2]}},
                }
            }
        )
        other.create_world(world, 2)
        other.set_body_state(np.tile([5, 5, 5, 0, 0, 0, 1.0], (2, 1, 1)), bodies=[world_body(other, "lamp")])
        state, before = env.engine.world_state(), other.world_state()
        with pytest.raises(SnapshotError, match=r"state alone has .*ball.*world alone has body lamp.*missing='keep'"):
            other.set_world_state(state)
        assert (other.world_state().body_pose == before.body_pose).all()
        carried = other.set_world_state(state, missing="keep")
        assert "body ball" in carried.dropped
        assert carried.kept == ("body lamp",)
        poses, block = other.get_state().body_pose, world_body(other, "block")
        assert np.allclose(poses[:, block], state.body_pose[:, state.bodies.index("block")])
        assert np.allclose(poses[:, world_body(other, "lamp"), :3], 5.0)


def world_body(engine: SimEngine, name: str) -> int:
    return engine.index.body(name)


def test_a_state_without_commands_holds_where_the_joints_are() -> None:
    with moving("null") as env:
        full = env.engine.world_state()
        bare = WorldState(
            full.time,
            full.entities,
            full.present,
            full.bodies,
            full.body_pose,
            full.body_twist,
            full.joints,
            full.joint_pos,
            full.joint_vel,
        )
        env.reset(seed=9)
        env.engine.set_world_state(bare)
        assert np.allclose(env.engine.control.position, full.joint_pos)


def test_a_light_that_was_changed_is_carried() -> None:
    with NullEngine() as first, NullEngine() as second:
        first.create_world(worlds.lit(), 2)
        second.create_world(worlds.lit(), 2)
        built = second.get_parameters("light.intensity")
        first.set_parameters("light.intensity", 0.5 * built)
        assert second.set_world_state(first.world_state()) == ((), ())
        assert np.array_equal(second.get_parameters("light.intensity"), 0.5 * built)
        second.set_world_state(second.world_state())
        first.set_parameters("light.intensity", built)
        second.set_world_state(first.world_state())
        assert np.array_equal(second.get_parameters("light.intensity"), built)
