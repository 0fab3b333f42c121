"""The grammar of episodes: bound values, choices, repetitions, guards, checks, and the segments that they leave."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anysim import api, make
from anysim.conventions import Array
from anysim.errors import SnapshotError, SpecError
from anysim.skills.base import OUTCOMES, Outcome, Skill
from anysim.skills.commands import CommandSequence
from anysim.skills.phases import MovingSkill
from anysim.task.env import TaskEnv
from anysim_schemas.collect import CollectSpec

WORLDS = Path(__file__).parents[1] / "plugins/skills/worlds"
FILE = WORLDS / "drawn_commands.yaml"
CLOSED = {"term": "closed", "joint": "cabinet.drawer_1", "share": 0.06}
NOT_CLOSED = {"term": "below", "frame": "cabinet", "height": -1.0}


class Waits(MovingSkill):
    """Is done after a while, or fails; keeps what it was told."""

    phases = ("wait",)
    movers = ()

    def __init__(self, env: TaskEnv, params: Mapping[str, Any]) -> None:
        super().__init__(env)
        self.params = params
        self.left = np.zeros(env.num_envs, dtype=int)

    def start(self, env_ids: Array) -> None:
        Skill.begin(self, env_ids)
        self.left[env_ids] = self.params.get("steps", 2)

    def decide(self, ids: Array, at: Array) -> None:
        self.left[ids] -= 1
        self.outcome[ids[self.left[ids] < 0]] = OUTCOMES.index(Outcome(self.params.get("ends", "ok")))


@pytest.fixture(scope="module")
def env() -> Iterator[TaskEnv]:
    with make(FILE, engine="mujoco", num_envs=8) as env:
        yield env


def followed(env: TaskEnv, collect: Mapping[str, Any], seed: int = 3) -> tuple[CommandSequence, list[list[str]]]:
    """Every command that each env has been in, with the word that was drawn for it."""
    skill = bound(env, collect)
    ids = np.arange(env.num_envs)
    env.reset(seed=seed)
    skill.begin(ids)
    said: list[list[str]] = [[] for _ in ids]
    for _ in range(100):
        if (skill.outcome != 0).all():
            break
        skill.act(ids, np.zeros((env.num_envs, env.action_dim)))
        env.scene.elapsed[ids] += 1  # the clock alone: nothing has to move
        for i in ids[skill.outcome == 0]:
            number = int(skill.phase[i])
            name = f"{skill.phases[number]} {len(skill.segments(int(i), False))}"
            if said[i][-1:] != [name]:
                said[i].append(name)
    return skill, said


def bound(env: TaskEnv, collect: Mapping[str, Any]) -> CommandSequence:
    """The commands over skills that wait; what is drawn is that of the file."""
    spec = CollectSpec.model_validate({"bind": env.spec.collect.bind, **collect} if env.spec.collect else collect)
    return CommandSequence(spec, env, lambda name, params, env, path: Waits(env, params))


def test_values_are_drawn_by_name_and_one_choice_for_each_episode(env: TaskEnv) -> None:
    env.reset(seed=5)
    drawers = [str(draws["collect/bind.d"]) for draws in env.streams.draws]
    assert set(drawers) == {"drawer_1", "drawer_2"}
    assert {draws["collect/bind.share"] for draws in env.streams.draws} == {0.5, 0.7}
    assert [env.instruction(i) for i in range(8)] == [f"Open {d}, and close it again." for d in drawers]
    env.reset(seed=6)
    assert drawers != [draws["collect/bind.d"] for draws in env.streams.draws]
    env.reset(seed=5)
    assert drawers == [draws["collect/bind.d"] for draws in env.streams.draws]


def test_terms_follow_what_was_drawn(env: TaskEnv) -> None:
    env.reset(seed=5)
    names = [joint.name for joint in env.engine.world.joints]
    pulled = np.array([[0.1, 0.0]] * 8)  # the first drawer alone is open
    columns = np.array([names.index("cabinet.drawer_1"), names.index("cabinet.drawer_2")])
    env.engine.set_joint_state(pulled, np.zeros((8, 2)), joints=columns)
    env.scene.look(None)
    shut = np.array([env.mdp.judge()[0] for _ in range(env.mdp.spec.hold)])[-1]
    assert shut.tolist() == [draws["collect/bind.d"] == "drawer_2" for draws in env.streams.draws]


def test_commands_have_the_values_of_their_env(env: TaskEnv) -> None:
    skill = bound(env, {"commands": [{"do": "wait", "steps": "$share", "drawer": "cabinet.$d"}]})
    told = [one.params for one in skill.members[0].variants]  # type: ignore[attr-defined]
    assert told == [
        {"steps": share, "drawer": f"cabinet.{drawer}"} for share in (0.5, 0.7) for drawer in ("drawer_1", "drawer_2")
    ]
    env.reset(seed=5)
    which = skill.members[0]._which(np.arange(8))  # type: ignore[attr-defined]
    for number, draws in zip(which, env.streams.draws, strict=True):
        drawn = {"steps": draws["collect/bind.share"], "drawer": f"cabinet.{draws['collect/bind.d']}"}
        assert told[number] == drawn


def test_numbers_are_drawn_between_bounds_which_are_drawn_too() -> None:
    overrides = ["collect.bind.share={range: [0.5, 0.7], steps: 3}", "collect.bind.n={range: [2, 4]}"]
    term = "task.success.shut.share=$share"
    with make(FILE, engine="mujoco", num_envs=32, overrides=[*overrides, term]) as env:
        env.reset(seed=5)
        drawn = [(draws["collect/bind.share"], draws["collect/bind.n"]) for draws in env.streams.draws]
        assert {share for share, _ in drawn} == {0.5, 0.6, 0.7}
        assert {n for _, n in drawn} == {2, 3, 4}
        assert all(type(n) is int for _, n in drawn)
        skill = bound(env, {"commands": [{"do": "wait", "steps": "$n", "share": "$share"}]})
        which = skill.members[0]._which(np.arange(32))  # type: ignore[attr-defined]
        told = [skill.members[0].variants[k].params for k in which]  # type: ignore[attr-defined]
        assert told == [{"steps": n, "share": share} for share, n in drawn]


def test_policies_see_what_was_drawn() -> None:
    terms = ["{term: drawn, value: d}", "{term: drawn, value: share}"]
    with make(FILE, engine="mujoco", num_envs=8, overrides=[f"task.observations.asked=[{', '.join(terms)}]"]) as env:
        for seed in (5, 6):
            seen = env.reset(seed=seed)[0]["asked"]
            draws = [(d["collect/bind.d"], d["collect/bind.share"]) for d in env.streams.draws]
            told = [[d == "drawer_1", d == "drawer_2", np.float32(share)] for d, share in draws]
            assert seen.tolist() == np.array(told, dtype=np.float32).tolist()


def test_repetitions_end_early_where_a_condition_holds(env: TaskEnv) -> None:
    _, said = followed(env, {"commands": [{"repeat": 3, "body": ["a", "b"]}, "c"]})
    assert said[0] == ["1 a 0", "2 b 1", "3 a 2", "4 b 3", "5 a 4", "6 b 5", "7 c 6"]
    _, said = followed(env, {"commands": [{"repeat": 3, "body": ["a", "b"], "until": CLOSED}, "c"]})
    assert said[0] == ["7 c 0"]


def test_a_guard_passes_a_command_over(env: TaskEnv) -> None:
    _, said = followed(env, {"commands": ["a", {"do": "b", "if": NOT_CLOSED}, {"do": "c", "if": CLOSED}]})
    assert said[0] == ["1 a 0", "3 c 1"]


def test_a_check_that_does_not_hold_is_a_failure_of_the_command(env: TaskEnv) -> None:
    skill, _ = followed(env, {"commands": [{"do": "a", "success": CLOSED}, {"do": "b", "success": NOT_CLOSED}, "c"]})
    assert [OUTCOMES[o] for o in skill.outcome] == [Outcome.LOST] * 8
    assert [s["command"] for s in skill.segments(0, False)] == [1]


@pytest.mark.parametrize(
    ("on_fail", "outcome", "kept"),
    [("stop", Outcome.JAMMED, [1]), ("skip", Outcome.OK, [1, 3]), ("continue", Outcome.JAMMED, [1, 3])],
)
def test_what_a_failed_command_does_to_the_episode(
    env: TaskEnv, on_fail: str, outcome: Outcome, kept: list[int]
) -> None:
    commands = ["a", {"do": "b", "ends": "jammed"}, "c", {"do": "d", "save": False}]
    skill, _ = followed(env, {"commands": commands, "on_fail": on_fail})
    assert OUTCOMES[skill.outcome[0]] is outcome
    assert [s["command"] for s in skill.segments(0, False)] == kept


def test_segments_say_which_steps_are_whose(env: TaskEnv) -> None:
    skill, _ = followed(env, {"commands": [{"do": "a", "steps": 4}, {"do": "b", "steps": 6}]})
    first, second = skill.segments(0, False)
    assert first == {"segment": 0, "command": 1, "skill": "a", "attempt": 1, "first_step": 1, "last_step": 4}
    assert second == {"segment": 1, "command": 2, "skill": "b", "attempt": 1, "first_step": 5, "last_step": 10}


def test_what_is_drawn_is_in_snapshots_and_damage_is_refused(env: TaskEnv) -> None:
    env.reset(seed=5)
    before = {name: index.copy() for name, index in env.bindings.index.items()}
    snapshot = env.snapshot()
    env.reset(seed=6)
    env.reset_to(snapshot)
    assert all((before[name] == index).all() for name, index in env.bindings.index.items())
    snapshot.managers["task"]["bound.d"][0] = 2  # type: ignore[index]
    with pytest.raises(SnapshotError, match=r"bound\.d"):
        env.reset_to(snapshot)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            "collect.commands.0.part=cabinet.$e",
            r"collect.commands.0.part: '$e' is not bound; collect.bind has d, share",
        ),
        ("collect.commands.0.fractoin=$share", "did you mean 'fraction'"),
        ("collect.bind.share=[0.5]", "collect.bind.share"),
        ("collect.bind.share={range: [0.5, 1.2]}", "collect.commands.0.fraction"),
        ("collect.bind.share={range: [-0.1, 0.5]}", "collect.commands.0.fraction"),
        ("collect.bind.share={range: [0.8, 0.5]}", "collect.bind.share.range: the lower bound 0.8 is above"),
        ("collect.bind.share={range: [0.5, much]}", "collect.bind.share.range.1"),
        ("collect.bind.share={range: [0, 1], steps: 5}", "collect.bind.share.steps: whole numbers are drawn one by"),
        ("collect.bind.share={range: [0, 300]}", "collect.bind.share.range: 301 whole numbers, at most 256"),
        ("collect.bind.share={range: [0.5, 0.7], steps: 200}", "have 400 combinations"),
        ("collect.bind.d.choice=[drawer_1, drawer_9]", "task.success.shut.joint: 'cabinet' has no joint 'drawer_9'"),
        ("collect.bind.share.choice=[0.5, much]", "collect.commands.0.fraction"),
        ("collect.commands.1.weights=[1]", "collect.commands.1.weights: 2 branches need as many weights"),
        ("collect.commands.1.choose.0.do=clsoe", "no skill named 'clsoe' is installed; did you mean 'close'"),
        ("collect.commands.0.if={term: closd}", "no predicate term is named 'closd'; did you mean 'closed'"),
        ("collect.commands.1={repeat: 300, body: release}", "collect.commands.1.repeat"),
        ("task.rewards.lift={term: tanh_distance, a: $b, b: panda.tool, scale: 1.0}", "task.rewards.lift.a: '$b'"),
        ("task.observations.o=[{term: drawn, value: shar}]", "collect.bind has no 'shar'; did you mean 'share'"),
        ("task.events.x={term: push, object: $d, force: [1.0, 0.0, 0.0]}", "an event cannot refer to what is bound"),
    ],
)
def test_a_fault_is_told_with_its_place(change: str, words: str) -> None:
    with pytest.raises(SpecError) as fault:
        checked(change)
    assert words in str(fault.value)


def checked(change: str) -> None:
    loaded = api.load(FILE, overrides=[change])
    api.dry_run(loaded, api.compile_world(loaded))
