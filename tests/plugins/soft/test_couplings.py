"""Couplings of garments: with a robot that drives into one, and with soft matter through what lies between them."""

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
    """Matter does not meet matter of another family; what lies between trades with both, and bears the towel."""
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
