"""Comparison of engine states in the contract suite."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.model.world import World

FIELDS = ("body_pose", "body_twist", "joint_pos", "joint_vel", "joint_effort", "contact_force", "fault")
MOTION = FIELDS[:4]


def read(engine: SimEngine, rows: Sequence[int] | None = None, fields: Sequence[str] = FIELDS) -> dict[str, Array]:
    """Copies of state fields, and the time, of all envs or of some."""
    state = engine.get_state()
    which = slice(None) if rows is None else list(rows)
    return {name: np.array(getattr(state, name)[which]) for name in (*fields, "time")}


def assert_same(got: Mapping[str, Array], wanted: Mapping[str, Array], what: str) -> None:
    """Bit for bit, naming the first field that differs and by how much."""
    for name, value in wanted.items():
        if not np.array_equal(got[name], value):
            gap = np.abs(got[name].astype(float) - value.astype(float)).max()
            raise AssertionError(f"{what}: {name} differs by up to {gap:.3g}; equal bits expected")


def assert_close(got: Any, wanted: Any, tolerance: Any, what: str) -> None:
    """Within an absolute tolerance, naming the worst entry."""
    gap = np.abs(np.asarray(got, dtype=float) - wanted)
    worst = float(gap.max()) if gap.size else 0.0
    assert worst <= tolerance, f"{what}: off by {worst:.3g}, {tolerance:.3g} allowed (got {got}, expected {wanted})"


def assert_ratio(got: Any, wanted: float, tolerance: float, what: str) -> None:
    """Within a relative tolerance."""
    off = abs(float(got) - wanted) / abs(wanted)
    assert off <= tolerance, (
        f"{what}: {float(got):.6g}, expected {wanted:.6g}; off by {off:.2%}, {tolerance:.2%} allowed"
    )


def quaternions_apart(a: Array, b: Array) -> float:
    """The largest difference of quaternions (..., 4) up to sign."""
    sign = np.where((a * b).sum(axis=-1, keepdims=True) < 0, -1.0, 1.0)
    return float(np.abs(a - sign * b).max(initial=0.0))


def tape(world: World, envs: Sequence[int], length: int, seed: int = 0) -> Array:
    """Position targets (length, E, A) that wander about the initial ones; an env's own depend on its number alone."""
    start = np.array([world.joints[a.joint].initial for a in world.actuators])
    rows = [0.05 * np.random.default_rng([seed, env]).standard_normal((length, len(start))) for env in envs]
    return start + np.cumsum(np.stack(rows, axis=1), axis=0)


def play(engine: SimEngine, targets: Array, steps: int = 2, env_ids: Sequence[int] | None = None) -> None:
    """Run a tape: new targets, then a few steps, and so on."""
    for target in targets:
        engine.set_control(position=target, env_ids=env_ids)
        engine.step(steps, env_ids=env_ids)


def spread(engine: SimEngine, seed: int = 1) -> None:
    """Give every env its own joint positions and velocities of free bodies, by its number alone."""
    joints, free = len(engine.world.joints), [i for i, b in enumerate(engine.world.bodies) if b.kind == "free"]
    for env in range(engine.num_envs):
        rng = np.random.default_rng([seed, env])
        initial = np.array([j.initial for j in engine.world.joints])
        engine.set_joint_state(
            initial + 0.1 * rng.standard_normal(joints), 0.1 * rng.standard_normal(joints), env_ids=[env]
        )
        engine.set_body_state(twist=0.2 * rng.standard_normal((1, len(free), 6)), env_ids=[env], bodies=free)


def run_and_read(engine: SimEngine, world: World) -> dict[str, Array]:
    """A fixed run of two envs, for comparing processes."""
    engine.create_world(world, 2)
    spread(engine)
    play(engine, tape(world, [0, 1], 60))
    return read(engine)


def run_elsewhere(name: str, options: Mapping[str, Any]) -> dict[str, Array]:
    """The same run by the engine's name: what the other process does."""
    from anysim.testing import worlds
    from anysim.testing.plugin import load_engine

    with load_engine(name)(**options) as engine:
        return run_and_read(engine, worlds.buildable(engine))


def sliding_friction(engine: SimEngine, boxes: Sequence[int]) -> Array:
    """(len(boxes),) the coefficients by which boxes that rest at 2 ms are slowed down, set off along x at 3 m/s.

    Soft contacts let a box hop: the impulse along is taken over the impulse up, which is not its weight throughout.
    """
    engine.step(250)
    twist = np.array(engine.get_state().body_twist[0, boxes])
    twist[:, 0] += 3.0
    engine.set_body_state(twist=twist[None], bodies=boxes)
    engine.step(25)
    early = np.array(engine.get_state().body_twist[0, boxes])
    engine.step(75)
    change = engine.get_state().body_twist[0, boxes] - early
    return -change[:, 0] / (75 * 0.002 * 9.81 + change[:, 2])
