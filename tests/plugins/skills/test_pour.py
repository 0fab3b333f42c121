"""The skills to grasp a vessel from its side and to pour, on real engines: beads from a cup into a tray."""

import numpy as np
import pytest

from anysim import make
from anysim.conventions import Array
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_engine
from tests.plugins.skills.test_manipulation import WORLDS


def poured(engine: str, num_envs: int, *overrides: str) -> tuple[list[Outcome], Array]:
    """The outcomes, and how many beads lie in the tray (n,)."""
    require_engine(engine)
    with make(WORLDS / "pour.yaml", engine=engine, num_envs=num_envs, overrides=overrides) as env:
        env.reset(seed=11)
        policy, ids = SkillPolicy(env), np.arange(num_envs)
        policy.begin(ids)
        for _ in range(1000):
            if (policy.skill.outcome != 0).all():
                break
            env.step(policy.act(ids))
        bodies = env.engine.get_state().body_pose[..., :3]
        beads = [i for i, body in enumerate(env.engine.world.bodies) if body.name.startswith("bead")]
        seen = bodies[:, beads] - bodies[:, None, env.engine.index.body("tray")]
        inside = (np.abs(seen[..., :2]) < 0.12).all(axis=2) & (seen[..., 2] > 0.0) & (seen[..., 2] < 0.07)
        return [OUTCOMES[o] for o in policy.skill.outcome], inside.sum(axis=1)


@pytest.mark.slow
def test_beads_are_poured_on_mujoco() -> None:
    outcomes, beads = poured("mujoco", 1)
    assert outcomes == [Outcome.OK]
    assert (beads == 4).all()


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
def test_beads_are_poured_on_the_other_engines(engine: str) -> None:
    outcomes, beads = poured(engine, 2)
    assert outcomes == [Outcome.OK] * 2
    assert (beads >= 3).all()


@pytest.mark.slow
def test_a_tilt_that_is_too_small_pours_nothing() -> None:
    tilt = "collect.commands=[{do: grasp_side, object: cup, offset: [0, 0, 0.07]}, "
    tilt += "{do: pour, vessel: cup, into: tray, contents: bead, angle: 0.6}]"
    outcomes, beads = poured("mujoco", 1, tilt)
    assert outcomes == [Outcome.LOST]
    assert (beads == 0).all()


@pytest.mark.slow
def test_a_cup_too_wide_for_the_gripper_has_no_grasp_from_its_side() -> None:
    outcomes, _ = poured("mujoco", 1, "world.objects.cup.source.params.size=[0.085, 0.085, 0.12]")
    assert outcomes == [Outcome.NO_IK]
