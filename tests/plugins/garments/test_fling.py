"""The fling of cloth with two arms, with towels of few points."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest

import anysim
from anysim.conventions import Array
from anysim.errors import AnysimError
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from anysim_garments.cloth import Cloth, covered
from anysim_garments.fling import CLEAR
from anysim_soft.garment import Garment
from tests.tasks.states import blinding

FLAT = [f"world.families.towel.{key}" for key in ("tilt=0.0", "yaw=0.0", "turned=0.0", "folded=0.5")]
COARSE = [*FLAT, "world.families.towel.spacing=0.1"]
"""Few points are moved fast; to unfold as cloth does takes those of the task."""
FLING = "collect.commands=[{{do: cloth_fling, robot: {}, partner: {}, cloth: towel, at: {}, partner_at: {}{}}}]"
USUAL = FLING.format("panda", "partner", "[1, 1]", "[1, -1]", "")
FINE = "world.families.towel.spacing=0.0375"
Seen = Callable[[TaskEnv, str], None]


@contextmanager
def fling(*overrides: str, watch: Seen | None = None) -> Iterator[tuple[TaskEnv, SkillPolicy]]:
    """An env of `fling_towel` in which the commands have ended; `watch` sees the phase after each step."""
    require_engine("mujoco")
    changes = [*blinding("fling_towel"), "task.on_success=continue", *COARSE, *overrides]
    with anysim.make("fling_towel", engine="mujoco", num_envs=1, overrides=changes) as env:
        env.reset(seed=7)
        policy, everyone = SkillPolicy(env), np.array([0])
        policy.begin(everyone)
        while env.running.all() and not policy.skill.outcome.all():
            env.step(policy.act(everyone))
            if watch is not None:
                env.scene.look(None)
                watch(env, str(policy.describe(0)["phase"]).rpartition("fling: ")[2])
        yield env, policy


def towel(env: TaskEnv) -> Garment:
    assert env.families is not None
    found = env.families.family("towel")
    assert isinstance(found, Garment)
    return found


def share(env: TaskEnv) -> float:
    """Of its area, that the towel covers."""
    it = towel(env)
    flat = np.column_stack([it.cut.points, np.zeros(len(it.cut.points))])[None]
    return float(covered(it.x, it.cut.faces)[0] / covered(flat, it.cut.faces)[0])


def outcome(policy: SkillPolicy) -> Outcome:
    return OUTCOMES[policy.skill.outcome[0]]


def test_what_hangs_from_two_points_is_as_wide_and_as_long_as_it_is_cut() -> None:
    require_engine("mujoco")
    with anysim.make("fling_towel", engine="mujoco", overrides=[*blinding("fling_towel"), *COARSE]) as env:
        env.reset(seed=1)
        assert env.scene.families is not None
        cloth = Cloth(env.scene, env.scene.category("towel"))
        assert cloth.hanging(cloth.nearest([(1, 1), (1, -1)])) == pytest.approx((0.3, 0.45))
        assert cloth.hanging(cloth.nearest([(1, 1), (-1, 1)])) == pytest.approx((0.45, 0.3))
        diagonal = float(np.hypot(0.45, 0.3))
        assert cloth.hanging(cloth.nearest([(1, 1), (-1, -1)])) == pytest.approx((diagonal, 0.135 / diagonal))


@pytest.mark.slow
def test_a_fling_swings_a_taut_edge_as_fast_as_it_is_told_and_spreads_the_towel() -> None:
    """Both hands in step; free of the table before it swings; nothing pulled apart; nothing held in the end."""
    seen: dict[str, list[Array]] = {"hang": [], "forward": [], "lay": []}

    def watch(env: TaskEnv, phase: str) -> None:
        if phase in seen:
            it, tools = towel(env), [env.scene.frame(f"{name}.tool") for name in ("panda", "partner")]
            ends = [
                it.x[0, np.argmin(np.abs(it.cut.points - corner).sum(axis=1))]
                for corner in ([0.225, 0.15], [0.225, -0.15])
            ]
            speeds = [np.linalg.norm(tool.twist[0, :3]) for tool in tools]
            step = tools[0].position[0] - tools[1].position[0]
            lowest = it.x[0, :, 2].min() - 0.4
            seen[phase].append(np.array([*speeds, np.linalg.norm(ends[0] - ends[1]), step[0], step[2], lowest]))

    with fling(FINE, watch=watch) as (env, policy):
        assert outcome(policy) is Outcome.OK
        hang, forward, lay = (np.array(seen[phase]) for phase in ("hang", "forward", "lay"))
        assert 0.02 < hang[-1, 5] < 2 * CLEAR
        assert (np.abs(hang[:, 2] - 0.97 * 0.3) < 0.012).all(), hang[:, 2]
        assert (forward[:, 2] > 0.93 * 0.3).all()
        assert (forward[:, 2] < 1.1 * 0.3).all()
        for swing in (forward, lay):
            assert 0.8 < swing[:, :2].max() < 1.4, swing[:, :2].max(axis=0)
            assert np.abs(swing[:, 3:5]).max() < 0.03
        assert share(env) > 0.8
        assert not towel(env).state(np.array([0])).fields["held"].any()


@pytest.mark.slow
def test_without_a_swing_the_towel_stays_heaped() -> None:
    with fling(FLING.format("panda", "partner", "[1, 1]", "[1, -1]", ", swing: 0, draw: 0.28"), FINE) as (env, policy):
        assert outcome(policy) is Outcome.OK
        assert share(env) < 0.75


@pytest.mark.slow
def test_a_corner_that_comes_off_in_the_swing_is_an_unstable_grasp_or_taken_again() -> None:
    torn: list[bool] = []

    def tear(env: TaskEnv, phase: str) -> None:
        if phase == "forward" and not torn:
            torn.append(True)
            it = towel(env)
            it.pads.stage[0, 1], it.memory["pad_count"][0, 1] = 2, 0

    with fling(FLING.format("panda", "partner", "[1, 1]", "[1, -1]", ", rounds: 1"), watch=tear) as (_, policy):
        assert torn
        assert outcome(policy) is Outcome.UNSTABLE_GRASP
    torn.clear()
    with fling(USUAL, "task.horizon=320", watch=tear) as (_, policy):
        assert outcome(policy) is Outcome.RUNNING
        assert "unstable_grasp -> back to grasp" in str(policy.skill.describe(0)["ladder"])


@pytest.mark.slow
def test_a_hand_that_finds_nothing_has_missed() -> None:
    """With a reach of less than the height above cloth at which hands close."""
    with fling("world.families.towel.pads.partner.reach=0.001", "task.horizon=3000") as (_, policy):
        assert outcome(policy) is Outcome.MISSED_CONTACT


@pytest.mark.slow
def test_a_swing_that_arms_do_not_reach_is_no_ik() -> None:
    with fling(FLING.format("panda", "partner", "[1, 1]", "[1, -1]", ", out: 0.7")) as (_, policy):
        assert outcome(policy) is Outcome.NO_IK


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (FLING.format("panda", "partner", "[1, 1]", "[1, 1]", ""), "are one point; give two corners"),
        (FLING.format("panda", "panda", "[1, 1]", "[1, -1]", ""), "cannot be done at once: they move the same arm"),
    ],
)
def test_what_two_arms_cannot_do_is_refused(command: str, words: str) -> None:
    with pytest.raises(AnysimError, match=words), fling(command):
        pass
