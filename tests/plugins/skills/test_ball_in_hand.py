"""A ball in a hand with fingers: it is taken from the side whichever way it has rolled, and let go of."""

import numpy as np

from anysim import make
from anysim.math import pose as P
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_engine
from anysim_skills.grasping.dex_grasp import ANGLES, around, tilted
from tests.plugins.skills.test_pick import rollout
from tests.tasks.states import blinding, put, seen

TASK = "g1_place_in_bowl"


def test_a_ball_is_put_into_a_bowl_whichever_way_it_has_rolled() -> None:
    require_engine("mujoco")
    with make(TASK, engine="mujoco", num_envs=2, overrides=blinding(TASK)) as env:
        env.reset(seed=6)
        ball = seen(env, "ball")
        ball[:, 3:] = [P.from_roll_pitch_yaw(np.array(angles)) for angles in ([0.4, 1.1, 0.2], [-1.3, 0.3, 2.0])]
        put(env, "ball", ball)
        assert rollout(env, SkillPolicy(env), 700) == ["success"] * 2
        env.scene.look(None)
        fingers = env.scene.state.joint_pos[:, env.engine.index.joint("g1.right_hand_index_0_joint")]
        assert (np.abs(fingers) < 0.1).all(), "the hand is open"
        away = seen(env, "ball")[:, :3] - seen(env, "bowl.inside")[:, :3]
        assert (np.linalg.norm(away, axis=1) < 0.05).all()


def test_a_palm_that_is_tilted_looks_down_by_that_and_keeps_its_place() -> None:
    middle, place, angle = np.array([[0.3, -0.1, 0.8]]), np.array([-0.004, 0.018, 0.02]), 0.35
    level = around(middle, np.array([[0.0, 0.0, 1.0]]), place)
    leaning = tilted(level, middle, place, angle)
    z, points = np.zeros((1, 2 * ANGLES, 3)), np.broadcast_to(place, (1, 2 * ANGLES, 3))
    z[..., 2] = 1.0
    before, after = P.rotate(level[..., 3:], z), P.rotate(leaning[..., 3:], z)
    np.testing.assert_allclose(before[..., 2], 0.0, atol=1e-12)
    np.testing.assert_allclose(after[..., 2], -np.sin(angle))
    np.testing.assert_allclose(P.cross(before, after)[..., 2], 0.0, atol=1e-12)  # none turns aside
    held = leaning[..., :3] + P.rotate(leaning[..., 3:], points)
    np.testing.assert_allclose(held, np.broadcast_to(middle[:, None], held.shape))


def test_a_palm_that_looks_straight_down_is_left_as_it_is() -> None:
    middle, place = np.array([[0.3, -0.1, 0.8]]), np.array([0.0, 0.01, 0.02])
    down = around(middle, np.array([[1.0, 0.0, 0.0]]), place)
    out = P.rotate(down[..., 3:], np.broadcast_to([0.0, 0.0, 1.0], (1, 2 * ANGLES, 3)))
    straight = np.abs(out[..., 2]) > 1.0 - 1e-12
    assert straight.any()
    np.testing.assert_allclose(tilted(down, middle, place, 0.35)[straight], down[straight], atol=1e-9)
