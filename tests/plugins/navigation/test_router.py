"""Bases that a skill sends through furnished rooms, in an engine: by ways, past what stands there, or refused."""

import numpy as np
import pytest

from anysim import make
from anysim.errors import PluginError
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from anysim_navigation.movers import Movers
from anysim_navigation_bench.drives import HARD, drive
from tests.plugins.skills.test_navigate import WORLD


@pytest.mark.parametrize("base", ["differential_base", "holonomic_base"])
def test_a_base_gets_through_a_furnished_room(base: str) -> None:
    require_engine("mujoco")
    found = drive(1, base, "mujoco")
    assert found is not None
    assert found.ended == "success"
    assert found.length > 4.0
    assert found.hardest < HARD
    assert found.seconds < 3.0 * found.length / 0.6 + 10.0


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
@pytest.mark.parametrize("base", ["differential_base", "holonomic_base"])
def test_it_gets_through_on_the_other_engines(base: str, engine: str) -> None:
    require_engine(engine)
    found = drive(1, base, engine)
    assert found is not None
    assert (found.ended, found.hardest < HARD) == ("success", True)


@pytest.mark.parametrize(
    "room",  # where it ran into things before its sway or its delay was known
    [pytest.param(room, marks=pytest.mark.slow if room == 25 else pytest.mark.full) for room in (3, 4, 5, 12, 22, 25)],
)
def test_a_humanoid_gets_through(room: int) -> None:
    require_engine("mujoco")
    found = drive(room, "unitree_g1", "mujoco")
    assert found is not None
    assert (found.ended, found.hardest < HARD) == ("success", True)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("base", "room"),
    [("ackermann_base", 9), ("ackermann_base", 16), ("ackermann_base", 46), ("unitree_go1", 4)],  # cars shunt there
)
def test_cars_and_legs_get_through_as_well(base: str, room: int) -> None:
    require_engine("mujoco")
    found = drive(room, base, "mujoco")
    assert found is not None
    assert (found.ended, found.hardest < HARD) == ("success", True)


@pytest.mark.parametrize(
    "engine",
    ["mujoco", pytest.param("pybullet", marks=pytest.mark.slow), pytest.param("sapien", marks=pytest.mark.slow)],
)
def test_a_learned_gait_gets_through(engine: str) -> None:
    """It walks lower than it stands, by 2 cm: what is looked at is what is above its feet, and the floor is not."""
    require_engine(engine)
    found = drive(2, "unitree_go1_learned", engine)
    assert found is not None
    assert (found.ended, found.hardest < HARD) == ("success", True)


def walled(gap: bool, slit: float = 0.0) -> TaskEnv:
    """A goal behind a wall, which is 8 m long or has a passage at its side; beside it there may be a slit [m]."""
    require_engine("mujoco")
    wall = [
        f"world.objects.wall={{source: {{box: [0.1, {3.0 if gap else 8.0}, 1.0]}}, fixed: true}}",
        "world.layout.wall={position: [1.0, 0.0, 0.5]}",
        "world.layout.spot={position: [2.0, 0.0, -0.02], yaw: 0.0, checked: false}",
        "task.expert.planner=dynamic_window",
        "task.on_success=continue",
        "task.horizon=1200",
    ]
    if not gap:  # and walls from there to behind the goal
        wall[0:2] = [
            f"world.objects.wall={{source: {{box: [0.1, {4.0 - slit}, 1.0]}}, fixed: true}}",
            f"world.layout.wall={{position: [1.0, {2.0 + slit / 2}, 0.5]}}",
            "world.objects.other={source: {box: [0.1, 4.0, 1.0]}, fixed: true}",
            "world.layout.other={position: [1.0, -2.0, 0.5]}",
        ]
        for name, y in (("left", 3.9), ("right", -3.9)):
            wall += [
                f"world.objects.{name}={{source: {{box: [3.0, 0.1, 1.0]}}, fixed: true}}",
                f"world.layout.{name}={{position: [2.5, {y}, 0.5]}}",
            ]
        wall += [
            "world.objects.back={source: {box: [0.1, 8.0, 1.0]}, fixed: true}",
            "world.layout.back={position: [4.0, 0.0, 0.5]}",
        ]
    return make(WORLD, engine="mujoco", num_envs=1, overrides=wall)


def outcome(env: TaskEnv, steps: int) -> tuple[Outcome, float]:
    """How the skill ended, and where the base was farthest to the side on its way."""
    env.reset(seed=3)
    policy, one, aside = SkillPolicy(env), np.array([0]), 0.0
    policy.begin(one)
    for _ in range(steps):
        if policy.skill.outcome[0]:
            break
        env.step(policy.act(one))
        aside = max(aside, abs(float(env.scene.robot("base").base.position[0, 1])))
    return OUTCOMES[policy.skill.outcome[0]], aside


def test_a_wall_is_gone_around() -> None:
    with walled(gap=True) as env:
        ended, aside = outcome(env, 900)
        assert ended is Outcome.OK
        assert 1.5 + 0.25 < aside < 2.4


def test_a_goal_that_is_closed_off_is_refused() -> None:
    with walled(gap=False) as env:
        assert outcome(env, 100)[0] is Outcome.NO_PATH


@pytest.mark.slow
def test_a_gap_that_nothing_is_steered_through_is_given_up() -> None:
    with walled(gap=False) as env:
        env.reset(seed=3)
        policy = SkillPolicy(env)
        policy.begin(np.array([0]))
        policy.act(np.array([0]))
        slit = 2 * policy.skill.base.router.limits.radius + 0.05
    with walled(gap=False, slit=slit) as env:
        env.reset(seed=3)
        policy, one = SkillPolicy(env), np.array([0])
        policy.begin(one)
        for _ in range(1200):
            env.step(policy.act(one))
            if policy.skill.base.no_way[0]:
                break
        assert policy.skill.base.router.refused == {0: "the base does not get on along any way that it has tried"}


def test_a_planner_that_is_not_installed_is_named() -> None:
    require_engine("mujoco")
    with (
        pytest.raises(PluginError, match="no planner named 'teb'"),
        make(WORLD, engine="mujoco", overrides=["task.expert.planner=teb"]) as env,
    ):
        outcome(env, 3)


def test_movers_are_seen_with_the_velocity_that_they_have() -> None:
    """A box that slides at (0.3, 0.4) m/s, from a base that looks along y: to its right, and on its way ahead."""
    ball = (
        "world.objects.mover={source: {box: [0.4, 0.2, 0.5]}}",
        "world.layout.mover={position: [2.0, 1.0, 0.25]}",
        "world.layout.spot={position: [-1.0, 0.0, -0.02], checked: false}",
    )
    with make(WORLD, engine="null", num_envs=2, overrides=ball) as env:
        env.reset(seed=1)
        root = env.engine.world.entities[env.engine.world.entity_numbers["mover"]].root
        twist = env.engine.get_state().body_twist[:, root].copy()
        twist[1, :2] = (0.3, 0.4)
        env.engine.set_body_state(twist=twist[:, None], bodies=[root])
        env.scene.look(None)
        seen = Movers(env.scene, ["mover"]).around(np.array([0, 1]), np.array([[0.0, 0.0, np.pi / 2]] * 2))
        assert np.allclose(seen[:, 0, :2], [[1.0, -2.0]] * 2, atol=1e-6)
        assert np.allclose(seen[:, 0, 2:4], [[0.0, 0.0], [0.4, -0.3]], atol=1e-6)
        assert np.allclose(seen[:, 0, 4], 0.2)
