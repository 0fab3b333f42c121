"""A camera follows what rolls past it, and says where it has lost it."""

from pathlib import Path

import numpy as np
import pytest

from anysim import make
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_engine

WORLD = Path(__file__).parent / "worlds/look_at.yaml"
ASIDE = ["world.layout.ball={on: terrain, x: 1.2, y: -0.8}", "task.horizon=1000"]
EXPERT = "task.expert={{skill: track, robot: eye, camera: eye, target: ball, joints: [yaw, pitch], {}}}"


def followed(engine: str, speed: float, options: str) -> tuple[list[Outcome], np.ndarray]:
    """The outcomes, and the angles [rad] (S, N) off the axis from the moment on in which the ball was pushed."""
    require_engine(engine)
    with make(WORLD, engine=engine, num_envs=2, overrides=[*ASIDE, EXPERT.format(options)]) as env:
        env.reset(seed=11)
        policy, everyone = SkillPolicy(env), np.arange(2)
        policy.begin(everyone)
        ball = [body.name for body in env.engine.world.bodies].index("ball")
        angles = []
        while not policy.skill.outcome.all():
            if not angles and (policy.skill.phase == 1).all():
                twist = np.tile([0.0, speed, 0.0, -speed / 0.05, 0.0, 0.0], (2, 1, 1))
                env.engine.set_body_state(env.engine.get_state().body_pose[:, [ball]], twist, bodies=[ball])
                angles.append(np.zeros(2))
            env.step(policy.act(everyone))
            if angles:
                eye = env.engine.camera_poses("eye")
                env.scene.look(None)
                way = env.scene.frame("ball").position - eye[:, :3]
                along = P.rotate(eye[:, 3:], np.tile([0.0, 0.0, 1.0], (2, 1)))
                angles.append(np.arccos(np.clip(P.dot(along, way) / P.norm(way), -1, 1)))
        return [OUTCOMES[code] for code in policy.skill.outcome], np.array(angles)


def test_a_ball_that_rolls_past_is_kept_in_view() -> None:
    outcomes, angles = followed("mujoco", 0.4, "duration: 150")
    assert outcomes == [Outcome.OK] * 2
    assert (angles < 0.1).mean() > 0.95
    assert angles[40:].max() < 0.05  # once it is up to speed


def test_the_lead_is_what_keeps_it_in_the_middle() -> None:
    ahead, behind = (np.median(followed("mujoco", 0.4, f"duration: 100, lead: {lead}")[1][40:]) for lead in (0.2, 0.0))
    assert ahead < 0.5 * behind


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
def test_it_is_kept_in_view_on_the_other_engines(engine: str) -> None:
    outcomes, angles = followed(engine, 0.4, "duration: 150")
    assert outcomes == [Outcome.OK] * 2
    assert angles[40:].max() < 0.05


def test_a_head_that_is_too_slow_loses_it() -> None:
    outcomes, _ = followed("mujoco", 1.0, "duration: 250, rate: 0.1")
    assert outcomes == [Outcome.LOST] * 2
