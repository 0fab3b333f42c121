"""Couplings of garments and ropes: with a robot that drives into one, with soft blocks, also through a board."""

import numpy as np
import pytest

from anysim.testing.engines import require_engine
from tests.plugins.soft.softs import ALL, ENGINES, begun, run_of

EACH = pytest.mark.parametrize("engine", ["mujoco", *(pytest.param(e, marks=pytest.mark.slow) for e in ENGINES[1:])])
PANDA = {"robot": "franka_panda", "actions": {"arm": "joint_delta_position", "eef": "gripper_binary"}}


@EACH
def test_an_arm_that_drives_into_a_hanging_towel_trades_momentum_with_it_and_loses_none(engine):
    """Links of a robot, no pad: what the towel got from elsewhere and what the arm got add up, to 1e-6."""
    require_engine(engine)
    towel = {"kind": "garment", "towel": [0.3, 0.2], "spacing": 0.05, "drag": 1.0, "tilt": np.pi / 2}
    towel |= {"position": [0.62, 0.0, 0.4], "fixed": ["+x"]}
    with begun(run_of(towel, engine, {"robots": {"panda": PANDA}})) as (env, it):
        begun_at, fastest, action = it.x.copy(), 0.0, np.zeros((1, 8))
        action[0, [1, 3]] = 0.6
        for _ in range(25):
            env.step(action)
            fastest = max(fastest, float(np.abs(it.body_force(ALL)[..., :3]).max()))
        found = it.balance(ALL)
        lost = (found.now - found.begun - found.received + found.given)[0, :3]
        assert fastest > 0.05  # [N] on a link
        assert np.abs(it.x - begun_at)[..., 0].max() > 0.02
        assert np.abs(lost).max() <= 1e-6 * np.abs(found.given).max()


@EACH
def test_a_board_between_a_soft_block_and_a_towel_feels_both_and_nothing_is_lost(engine):
    """What lies between trades with both, and bears the towel."""
    require_engine(engine)
    block = {"kind": "deformable", "box": [0.1, 0.1, 0.06], "young": 2e4, "points": [3, 3, 3]}
    towel = {"kind": "garment", "towel": [0.12, 0.12], "spacing": 0.03, "areal_density": 3.0, "position": [0, 0, 0.1]}
    world = {"objects": {"board": {"source": {"box": [0.16, 0.16, 0.02]}, "mass": 0.3}}}
    world["layout"] = {"board": {"position": [0.0, 0.0, 0.071]}}
    run = run_of(towel, engine, world)
    run["world"]["families"]["block"] = block
    with begun(run) as (env, it):
        assert env.families is not None
        under = env.families.family("block")
        pressed = []
        for _ in range(50):
            env.step(np.zeros((1, 0)))
            pressed.append([it.body_force(ALL)[0, :, 2].sum(), under.body_force(ALL)[0, :, 2].sum()])
        for one in (it, under):
            found = one.balance(ALL)
            lost = (found.now - found.begun - found.received + found.given)[0, :3]
            assert np.abs(lost).max() <= 1e-6 * np.abs(found.given).max()
        down, up = np.mean(pressed[-20:], axis=0)
        assert down == pytest.approx(-it.mass(0) * 9.81, rel=0.1)
        assert up == pytest.approx((it.mass(0) + 0.3) * 9.81, rel=0.1)


BLOCK = {"kind": "deformable", "box": [0.12, 0.12, 0.1], "young": 1e4}
LAID = {
    "towel": {"kind": "garment", "towel": [0.2, 0.2], "spacing": 0.025, "position": [0.0, 0.0, 0.11], "drag": 1.0},
    "rope": {"kind": "rope", "path": [[-0.04, 0, 0], [0.04, 0, 0]], "position": [0, 0.01, 0.108], "segments": 8},
}
RADII = {"towel": 0.0025 + 0.001, "rope": 0.005 + 0.001}
"""[m] of what lies on the block, and of the block's skin."""


@EACH
@pytest.mark.parametrize("what", LAID)
def test_what_lies_on_a_soft_block_presses_it_with_its_weight_and_nothing_is_lost(what, engine):
    require_engine(engine)
    run = run_of(LAID[what], engine, {})
    run["world"]["families"] = {"block": BLOCK, **run["world"]["families"]}
    with begun(run) as (env, it):
        block, forces = env.families.family("block"), []
        top = block.x[0, :, 2].max()
        for number in range(60):
            env.step(np.zeros((1, 0)))
            if number >= 40:  # what it got in the last step, and acts on in its next
                forces.append(block.due[0].sum(axis=0) / 0.004)
        assert np.mean(forces, axis=0) == pytest.approx([0.0, 0.0, -it.mass(0) * 9.81], abs=0.02 * it.mass(0) * 9.81)
        inside = np.abs(it.x[0, :, :2]).max(axis=1) < 0.03
        apart = it.x[0, inside, 2] - block.x[0, :, 2].max()
        assert inside.sum() >= 4
        assert apart.min() > 0.8 * RADII[what]
        assert apart.max() < 1.6 * RADII[what]
        assert block.x[0, :, 2].max() < top
        pressed = it.mass(0) * 9.81 * 60 * 0.02
        for one in (it, block):
            found = one.balance(ALL)
            assert np.abs((found.now - found.begun - found.received + found.given)[0, :3]).max() <= 1e-9 * pressed


@pytest.mark.parametrize(
    "change", [{"fixed": ["-z"]}, {"cells": [2, 1, 1], "points": [4, 5, 3]}, {"points": [6, 6, 3]}]
)
def test_blocks_of_any_make_bear_a_towel_whichever_the_world_declares_first(change):
    """Also where its points are exactly below those of the cloth: a thousand contacts that say the same."""
    run = run_of({**LAID["towel"], "spacing": 0.024, "towel": [0.192, 0.192]}, "mujoco", {})
    run["world"]["families"] = {**run["world"]["families"], "block": {**BLOCK, **change}}
    with begun(run) as (env, it):
        block = env.families.family("block")
        for _ in range(50):
            env.step(np.zeros((1, 0)))
        assert np.abs(it.x[0, :, :2]).max() < 0.11
        assert it.x[0, :, 2].min() > 0.04
        found = block.balance(ALL)
        assert np.abs((found.now - found.begun - found.received + found.given)[0, :3]).max() <= 1e-6 * it.mass(0) * 9.81
        sub = block.sub_world(0)
        sub.load(block.state_row[0])
        assert np.abs(block._shares.T @ sub.node_places() - sub.points()[block.shell]).max() < 1e-12


def test_a_towel_on_a_block_goes_on_from_a_snapshot_and_alone_to_the_bit():
    run = run_of({**LAID["towel"], "areal_density": {"range": [0.2, 0.6]}}, "mujoco", {})
    run["world"]["families"]["block"] = {**BLOCK, "density": {"range": [500.0, 1500.0]}}
    with begun(run, num_envs=2) as (env, it):
        for _ in range(15):
            env.step(np.zeros((2, 0)))
        snapshot = env.snapshot()
        for _ in range(5):
            env.step(np.zeros((2, 0)))
        expected = it.x.copy(), env.families.family("block").x.copy()
        assert (expected[0][0] != expected[0][1]).any()
        env.reset(seed=9)
        env.reset_to(snapshot)
        for _ in range(5):
            env.step(np.zeros((2, 0)))
        found = it.x, env.families.family("block").x
        assert all(np.array_equal(one, other) for one, other in zip(found, expected, strict=True))
        env.reset_to(snapshot)
        env.reset(mask=np.array([False, True]))
        for _ in range(5):
            env.step(np.zeros((2, 0)))
        assert np.array_equal(it.x[0], expected[0][0])


def test_the_friction_of_a_block_is_that_of_the_episode():
    run = run_of(LAID["towel"], "mujoco", {})
    run["world"]["families"]["block"] = {**BLOCK, "friction": {"range": [0.1, 2.0]}}
    with begun(run) as (env, it):
        seen = set()
        for seed in range(3):
            env.reset(seed=seed)
            env.step(np.zeros((1, 0)))
            drawn = env.families.family("block").parameter("friction", 0)
            assert it.sub_world(0).model.flex_friction[1, 0] == drawn
            seen.add(drawn)
        assert len(seen) == 3
