"""The skill wipe on real engines: a patch is covered, as contact forces tell it, with a force that stays bounded."""

import numpy as np
import pytest

from anysim import make
from anysim.conventions import Array
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_engine
from tests.plugins.skills.test_manipulation import WORLDS
from tests.tiers import others

WIDTH = 0.05
SIZE = np.array([0.15, 0.11])


def wiped(engine: str, num_envs: int, *overrides: str) -> tuple[list[Outcome], Array, Array]:
    """The outcomes, the shares (n,) of a fine grid that a pressed sponge has been over, the forces (T, n) [N] on it."""
    require_engine(engine)
    half = SIZE / 2 - 0.005
    cells = np.stack(np.meshgrid(*(np.linspace(-h, h, 25) for h in half)), axis=-1).reshape(-1, 2)
    covered, forces = np.zeros((num_envs, len(cells)), dtype=bool), []
    with make(WORLDS / "wipe.yaml", engine=engine, num_envs=num_envs, overrides=overrides) as env:
        env.reset(seed=11)
        policy, ids = SkillPolicy(env), np.arange(num_envs)
        policy.begin(ids)
        patch, sponge = env.scene.goals["patch"][:, :2], env.engine.index.body("sponge")
        for _ in range(3000):
            if (policy.skill.outcome != 0).all():
                break
            env.step(policy.act(ids))
            state = env.engine.get_state()
            pressed = state.contact_force[:, 0, 2]
            place = state.body_pose[:, sponge, :2] - patch
            near = np.linalg.norm(cells - place[:, None], axis=2) <= WIDTH / 2
            covered |= near & (pressed > 1.0)[:, None]
            forces.append(pressed)
        return [OUTCOMES[o] for o in policy.skill.outcome], covered.mean(axis=1), np.array(forces)


@pytest.mark.slow
def test_a_patch_is_wiped_on_mujoco() -> None:
    outcomes, covered, forces = wiped("mujoco", 2)
    assert outcomes == [Outcome.OK] * 2
    assert (covered >= 0.9).all()
    assert forces.max() < 40.0


@pytest.mark.parametrize("engine", others("pybullet"))
def test_a_patch_is_wiped_on_the_other_engines(engine: str) -> None:
    outcomes, covered, forces = wiped(engine, 4)
    assert outcomes.count(Outcome.OK) >= 3
    assert (covered[[outcome is Outcome.OK for outcome in outcomes]] >= 0.85).all()
    assert forces.max() < 60.0


@pytest.mark.slow
def test_a_patch_in_the_air_is_not_wiped() -> None:
    outcomes, covered, _ = wiped("mujoco", 1, "task.command.patch.height=0.15", "task.horizon=3000")
    assert outcomes == [Outcome.MISSED_CONTACT]
    assert covered.max() == 0.0
