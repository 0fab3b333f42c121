"""Movers: named or found, foreseen while they move, gone around while they stand, and replayed."""

from typing import Any

import numpy as np
import pytest

import anysim
from anysim import make
from anysim.api import compile_world
from anysim.errors import AnysimError
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from anysim_navigation.agent import NoRoute
from anysim_navigation.base_planner import PlannedBase
from anysim_navigation.movers import STRIDE, Movers, movers_of
from anysim_navigation.router import _roomiest
from anysim_navigation_bench.drives import HARD, drive
from tests.tiers import others

BALL = {"source": {"box": [0.4, 0.4, 0.4]}}
WORLD: dict[str, Any] = {
    "name": "crossing",
    "terrain": "plane",
    "robots": {
        "base": {"robot": "holonomic_base", "actions": {"base": "holonomic_drive"}},
        "other": {"robot": "differential_base", "position": [-2.0, 2.0, 0.0]},
        "rail": {"robot": "unitree_g1_assisted", "position": [-3.0, -2.0, 0.0]},
    },
    "objects": {"ball": BALL, "post": BALL | {"fixed": True}},
    "layout": {"ball": {"position": [3.0, 3.0, 0.2]}, "post": {"position": [3.0, -3.0, 0.2]}},
    "families": {
        "ann": {"kind": "avatar", "x": 1.5, "y": -1.2, "yaw": 1.57, "do": [{"go_to": [1.5, 1.6], "speed": 0.5}]}
    },
}


DRIVES: dict[str, Any] = {
    "holonomic_base": WORLD["robots"]["base"],
    "ackermann_base": {
        "robot": "ackermann_base",
        "actions": {"base": {"controller": "ackermann_drive", "params": {"steer_by": "rate"}}},
    },
}


def crossing(engine: str, expert: dict[str, Any], do: list[Any] | None = None, base: str = "holonomic_base") -> TaskEnv:
    """A base on its way to where ann crosses its path."""
    require_engine(engine)
    ann = WORLD["families"]["ann"] | ({} if do is None else {"do": do})
    world = WORLD | {"robots": {"base": DRIVES[base]}, "families": {"ann": ann}}
    world |= {"contact_sensors": {"met": {"body": "ann", "against": "base"}}}
    task = {
        "horizon": 2000,
        "command": {"goal": {"term": "goal_pose", "position": [3.0, 0.0, 0.08]}},
        "observations": {"policy": [{"term": "relative_pose", "a": "base", "b": "goal"}]},
        "expert": {"skill": "navigate", "robot": "base", "goal": "goal", **expert},
    }
    run = {"physics": {"dt": 0.004, "control_dt": 0.02}, "world": world, "task": task, "record": {"cameras": []}}
    return make(run, engine=engine, num_envs=1)


def gone(env: TaskEnv, policy: SkillPolicy, steps: int) -> tuple[np.ndarray, float]:
    """Where the base was in each step (K, 7), and the hardest contact with ann [N]."""
    base, seen, hardest = env.scene.robot("base").base, [], 0.0
    for _ in range(steps):
        if policy.skill.outcome[0]:
            break
        env.step(policy.act(np.array([0])))
        seen.append(base.pose[0].copy())
        hardest = max(hardest, float(np.linalg.norm(env.engine.get_state().contact_force)))
    return np.array(seen), hardest


def begun(env: TaskEnv) -> SkillPolicy:
    env.reset(seed=2)
    policy = SkillPolicy(env)
    policy.begin(np.array([0]))
    return policy


def test_a_base_that_recovers_makes_for_where_no_mover_will_be() -> None:
    """A wall 0.4 m behind: it makes for the front, where a person walks up to the side, out of the way."""
    columns = 0.05 * (np.arange(61) - 30)
    field = np.tile(np.clip(columns + 0.4, 0.0, None), (61, 1))
    np.testing.assert_allclose(_roomiest(field, 0.05, np.zeros((0, 5))), [0.35, 0.0], atol=1e-9)
    person = np.array([[1.0, 0.0, -0.6, 0.0, 0.3]])
    assert abs(_roomiest(field, 0.05, person)[1]) > 0.3


def test_people_and_other_robots_are_movers_where_none_are_named() -> None:
    world = compile_world({"world": WORLD})
    assert movers_of(world, "base") == ("other", "rail", "ann")
    assert movers_of(world, "base", ["ball", "ann"]) == ("ball", "ann")
    assert movers_of(world, "base", []) == ()
    for name, why in (("post", "is fixed to the world"), ("balk", "is nothing beside 'base'; did you mean 'ball'")):
        with pytest.raises(AnysimError, match=f"the mover '{name}' {why}"):
            movers_of(world, "base", [name])


def test_who_stands_is_on_the_map_and_who_moves_is_not() -> None:
    with crossing("null", {"planner": "dynamic_window"}) as env:
        env.reset(seed=1)
        env.scene.look(None)
        movers, ann = Movers(env.scene, ["ann"]), env.engine.world.entity_numbers["ann"]
        assert movers.there(0, standing=True)[ann]
        assert not movers.there(0, standing=False)[ann]
        env.step(np.zeros((1, 3)))
        for _ in range(40):
            env.step(np.zeros((1, 3)))
        env.scene.look(None)
        assert not movers.there(0, standing=True)[ann]
        assert movers.there(0, standing=True).sum() == len(env.engine.world.entities) - 1


def test_people_take_the_room_that_their_feet_take_beside_a_low_base() -> None:
    with crossing("null", {"planner": "dynamic_window"}) as env:
        env.reset(seed=1)
        for _ in range(80):
            env.step(np.zeros((1, 3)))
        env.scene.look(None)
        before, behind = Movers(env.scene, ["ann"], 0.3).around(np.array([0]), np.zeros((1, 3)))[0]
        speed = np.hypot(*before[2:4])
        assert np.allclose(before[2:], behind[2:])
        assert speed > 0.4
        assert np.allclose(before[:2] - behind[:2], 2 * STRIDE * before[2:4])
        tall, _ = Movers(env.scene, ["ann"], 1.3).around(np.array([0]), np.zeros((1, 3)))[0]
        assert 0.15 < before[4] < 0.3 < tall[4] < 0.45
        (around,) = Movers(env.scene, ["ann"], strides=False).around(np.array([0]), np.zeros((1, 3)))[0]
        assert np.allclose(around[:2], 0.5 * (before[:2] + behind[:2]), atol=0.03)
        assert around[4] == tall[4]


def test_who_turns_as_she_sets_out_is_foreseen_with_the_pace_that_she_gets_to() -> None:
    """A quarter turn: while she walks at less than half of her 0.5 m/s, that is what is foreseen, within a fifth."""
    with crossing("null", {"planner": "dynamic_window"}, [{"go_to": [3.5, -1.2], "speed": 0.5}]) as env:
        env.reset(seed=1)
        movers, root = Movers(env.scene, ["ann"], 0.3), env.engine.world.entities[-1].root
        slow = []
        for _ in range(60):
            env.step(np.zeros((1, 3)))
            env.scene.look(None)
            pace = np.hypot(*env.engine.get_state().body_twist[0, root, :2])
            seen = np.hypot(*movers.around(np.array([0]), np.zeros((1, 3)))[0, 0, 2:4])
            if 0.08 < pace < 0.25:
                slow.append(seen)
        assert len(slow) > 3
        np.testing.assert_allclose(slow, 0.5, atol=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("to", [1.6, 0.0])
def test_a_base_gets_past_a_person_who_crosses_its_way_or_stops_on_it(to: float) -> None:
    with crossing("mujoco", {"planner": "dynamic_window"}, [{"go_to": [1.5, to], "speed": 0.5}]) as env:
        policy = begun(env)
        _, hardest = gone(env, policy, 900)
        assert (OUTCOMES[policy.skill.outcome[0]], hardest) == (Outcome.OK, 0.0)


@pytest.mark.slow
def test_one_that_goes_straight_meets_her() -> None:
    """What the test above shows is the planner's doing."""
    with crossing("mujoco", {}) as env:
        assert gone(env, begun(env), 300)[1] > HARD


@pytest.mark.slow
def test_who_waits_until_a_person_leaves_its_goal_is_not_held_up() -> None:
    """She stands on it for 24 s, longer than all tries of a base that nobody is in the way of."""
    do = [{"go_to": [3.0, 0.0], "speed": 0.6}, {"clip": "idle", "seconds": 24.0}, {"go_to": [3.0, 3.0], "speed": 0.6}]
    with crossing("mujoco", {"planner": "dynamic_window"}, do) as env:
        policy, dt = begun(env), env.engine.world.physics.control_dt
        seen, hardest = gone(env, policy, 2000)
        assert OUTCOMES[policy.skill.outcome[0]] is Outcome.OK
        waited = (np.hypot(*(seen[:, :2] - [3.0, 0.0]).T) < 1.2).sum() * dt
        assert waited > 20.0
        assert hardest == 0.0


def test_movers_need_a_planner() -> None:
    with (
        pytest.raises(anysim.errors.TaskError, match="are foreseen by a planner; add `planner: dynamic_window`"),
        crossing("null", {"movers": ["ann"]}) as env,
    ):
        SkillPolicy(env)


def test_a_drive_among_people_goes_on_from_a_snapshot_bit_for_bit() -> None:
    with crossing("mujoco", {"planner": "dynamic_window"}) as env:
        policy, one = begun(env), np.array([0])
        gone(env, policy, 63)
        base = policy.skill.movers[0]
        assert isinstance(base, PlannedBase)
        assert base.router is not None
        env_then, router_then = env.snapshot(), base.router.snapshot(one)
        first, _ = gone(env, policy, 40)
        env.reset_to(env_then)
        base.router.restore(one, router_then)
        again, _ = gone(env, policy, 40)
        assert np.array_equal(first, again)
        env.reset_to(env_then)  # and without what the router knew it goes another way
        assert not np.array_equal(first, gone(env, policy, 40)[0])


@pytest.mark.parametrize(("movers", "refused"), [({}, False), ({"movers": []}, True)])
def test_a_car_where_no_way_of_a_car_begins_is_refused_without_people_only(
    movers: dict[str, Any], refused: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """People may have driven it there: it has a way over the mesh, along which the search gets it out."""

    def nothing(*_: object, **__: object) -> None:
        raise NoRoute("no way of a car")

    monkeypatch.setattr("anysim_navigation.router.car_way", nothing)
    with crossing("mujoco", {"planner": "dynamic_window", **movers}, base="ackermann_base") as env:
        policy = begun(env)
        gone(env, policy, 20)
        driver = policy.skill.movers[0]
        assert isinstance(driver, PlannedBase)
        assert driver.router is not None
        assert list(driver.router.refused.values()) == ["no way of a car"] * refused
        assert driver.router.twist.any() != refused


@pytest.mark.parametrize(("base", "steps"), [("holonomic_base", 60), ("ackermann_base", 40)])
def test_an_episode_does_not_depend_on_where_the_last_one_was_cut_off(base: str, steps: int) -> None:
    with crossing("mujoco", {"planner": "dynamic_window"}, base=base) as env:
        policy, one = begun(env), np.array([0])
        first, _ = gone(env, policy, steps)
        driver = policy.skill.movers[0]
        assert isinstance(driver, PlannedBase)
        assert driver.router is not None
        while not driver.router.twist.any():  # it may have stopped for ann
            assert len(gone(env, policy, 1)[0])
        env.reset(seed=2)
        policy.begin(one)
        rows = driver.router.snapshot(one)[0].rows
        assert not rows["twist"].any()
        assert (rows["_plan"] == driver.router.search.no_plan).all()
        again, _ = gone(env, policy, steps)
        assert np.array_equal(first, again)


@pytest.mark.parametrize("engine", [*others("pybullet"), pytest.param("mujoco", marks=pytest.mark.full)])
def test_a_room_is_crossed_among_four_people(engine: str) -> None:
    require_engine(engine)
    found = drive(1, "holonomic_base", engine, people=4)
    assert found is not None
    assert (found.ended, found.met != "towards") == ("success", True)


@pytest.mark.parametrize(
    ("base", "room"),  # in each of which the best single velocity was caught, and a trot without steps to its sides
    [
        pytest.param("unitree_go1", 19, marks=pytest.mark.slow),
        pytest.param("differential_base", 8, marks=pytest.mark.slow),
        pytest.param("differential_base", 12, marks=pytest.mark.full),
        pytest.param("ackermann_base", 5, marks=pytest.mark.full),
        pytest.param("holonomic_base", 12, marks=pytest.mark.full),
        pytest.param("holonomic_base", 17, marks=pytest.mark.full),
    ],
)
def test_a_base_gives_way_to_people_and_gets_through(base: str, room: int) -> None:
    require_engine("mujoco")
    found = drive(room, base, "mujoco", people=4)
    assert found is not None
    assert (found.ended, found.met) == ("success", "")
