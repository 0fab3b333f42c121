"""Looking ahead: a grasp with which what comes next cannot be done is not chosen, and none where there is no other."""

from typing import Any, NamedTuple

import numpy as np
import pytest

from anysim import make
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import MovingSkill, PhasedSkill
from anysim.skills.runner import SkillPolicy
from anysim.task.contract import Status
from anysim_skills.grasping.bring import Bring
from anysim_skills.grasping.place import Place
from anysim_skills.insertion.pull_out import PullOut
from anysim_skills.look_ahead import LookAhead
from anysim_skills.moving.pull import Pull
from anysim_skills.moving.slide import Slide
from anysim_skills.moving.wipe import Wipe
from anysim_skills.pouring.pour import Pour
from tests.plugins.skills.test_manipulation import WORLDS
from tests.plugins.skills.test_pick import rollout
from tests.tiers import often

OUT_OF_REACH = {
    "pick_cube": ("cube", ["task.command.goal.x=0.75", "task.command.goal.y=0.6"]),
    "place_on_pad": ("cube", ["world.layout.pad.x=0.75", "world.layout.pad.y=0.6"]),
    "peg_in_hole": ("peg", ["world.layout.block.x=0.75", "world.layout.block.y=0.6"]),
    "handover": ("bar", ["task.command.meeting.height=1.2"]),
}


@pytest.mark.parametrize("task", OUT_OF_REACH)
def test_what_cannot_be_used_next_is_not_grasped(task: str) -> None:
    thing, overrides = OUT_OF_REACH[task]
    with make(task, engine="mujoco", overrides=["record.cameras=[]", *overrides]) as env:
        env.reset(seed=2)
        policy = SkillPolicy(env)
        body = env.engine.index.body(thing)
        begin = env.engine.get_state().body_pose[0, body, :3].copy()
        rollout(env, policy, 300)
        assert OUTCOMES[policy.skill.outcome[0]] is Outcome.NO_IK
        assert policy.describe(0)["phase"] == "grasp: choose"
        assert np.abs(env.engine.get_state().body_pose[0, body, :3] - begin).max() < 0.01


@pytest.mark.parametrize("target", ["pad", "$on"])
def test_a_command_looks_ahead_at_the_next_one(target: str) -> None:
    commands = f"[{{do: grasp, object: cube}}, {{do: place, object: cube, target: {target}}}]"
    collect = f"collect={{bind: {{on: {{choice: [pad, table], weights: [1, 0]}}}}, commands: {commands}}}"
    with make("place_on_pad", engine="mujoco", overrides=[*OUT_OF_REACH["place_on_pad"][1], collect]) as env:
        env.reset(seed=2)
        policy = SkillPolicy(env)
        rollout(env, policy, 300)
        assert OUTCOMES[policy.skill.outcome[0]] is Outcome.NO_IK
        assert policy.describe(0)["phase"] == "1 grasp: choose"


def at(thing: str, x: float, y: float, yaw: float) -> list[str]:
    return [f"world.layout.{thing}.x={x}", f"world.layout.{thing}.y={y}", f"world.layout.{thing}.yaw={yaw}"]


def commands(*words: str) -> str:
    return f"collect={{commands: [{', '.join(f'{{do: {one}}}' for one in words)}]}}"


FAR_PAD = OUT_OF_REACH["place_on_pad"][1]
NOT_BEGUN: dict[str, tuple[Any, list[str], str]] = {
    "1 pick: grasp": (
        "place_on_pad",
        [*FAR_PAD, commands("pick, object: cube, goal: cube", "place, object: cube, target: pad")],
        "what comes after `bring`",
    ),
    "2 regrasp: grasp": (
        "place_on_pad",
        [
            *FAR_PAD,
            "task.command.here={term: goal_above, surface: table, x: 0.1, y: 0.2, height: 0.0}",
            commands("lift, object: cube", "regrasp, object: cube, target: here", "place, object: cube, target: pad"),
        ],
        "a grasp that is the end of a command",
    ),
    "1 handover: take": (
        "handover",
        [
            "task.command.far={term: goal_above, surface: table, x: 0.0, y: 0.0, height: 1.2}",
            commands(
                "handover, robot: panda, receiver: partner, object: bar, meeting: meeting, give: [-0.05, 0, 0], "
                "take: [0.05, 0, 0]",
                "bring, robot: partner, object: bar, goal: far",
            ),
        ],
        "the receiver goes on with the bar",
    ),
    "1 unplug: grasp": (WORLDS / "unplug.yaml", ["collect.commands.0.clear=1.0"], "the way out of the hole"),
    "grasp": (WORLDS / "extract_peg.yaml", ["task.expert.clear=1.0"], "the way out of the hole"),
    "choose": ("lift_cube", ["task.expert.height=1.0"], "the lift of the grasp itself"),
}


@pytest.mark.parametrize("phase", NOT_BEGUN)
def test_what_leads_nowhere_is_not_begun(phase: str) -> None:
    source, overrides, why = NOT_BEGUN[phase]
    with make(source, engine="mujoco", overrides=["record.cameras=[]", *overrides]) as env:
        env.reset(seed=2)
        policy = SkillPolicy(env)
        rollout(env, policy, 1200)
        assert OUTCOMES[policy.skill.outcome[0]] is Outcome.NO_IK, why
        assert policy.describe(0)["phase"] == (phase if phase == "choose" else f"{phase}: choose"), why


# ---------------------------------------------------------------------- the nearest grasp that can go on


class Case(NamedTuple):
    """Where the nearest grasp does not do for what comes next, and others do."""

    source: Any
    follower: type[MovingSkill]
    overrides: list[str]
    without: set[Outcome]
    """How it ends if that is not looked at; empty where it gets there in a roundabout way."""
    seed: int = 0


AT_END = ["world.objects.cube.source.box=[0.04, 0.16, 0.04]", *at("cube", 0.462, -0.196, -0.158)]
"""A bar that is grasped at one end, and a place for it beside the robot, where its wrist has to turn far."""
BESIDE = "world.layout.pad={on: table, x: -0.1, y: 0.3}"
LONG = ["world.objects.sponge.source.box=[0.3, 0.03, 0.04]", "collect.commands.0.offset=[-0.1, 0, 0]"]
DEEP = "world.objects.tray.source.params.size=[0.14, 0.14, 0.15]"
SIDEWAYS = [
    *at("hook", 0.318, -0.201, 0.864),
    *at("cube", 0.46, 0.214, -0.685),
    "task.command.spot.x=0.059",
    "task.command.spot.y=0.202",
]
ASIDE = "world.layout.block={on: table, x: 0.4, y: -0.3, yaw: -0.75}"

CASES = {
    "drag": Case(
        "place_on_pad",
        Slide,
        [*AT_END, BESIDE, commands("drag, object: cube, goal: pad, offset: [0, 0.06, 0], tolerance: 0.02")],
        {Outcome.JAMMED},
    ),
    "regrasp": Case(
        "place_on_pad",
        Place,
        [*AT_END, BESIDE, commands("lift, object: cube, offset: [0, 0.06, 0]", "regrasp, object: cube, target: pad")],
        {Outcome.NO_IK},
    ),
    "bring, then place": Case(
        "place_on_pad",
        Place,
        [
            *AT_END,
            BESIDE,
            "task.command.over={term: goal_above, surface: table, x: 0.162, y: -0.196, height: 0.15}",
            commands(
                "grasp, object: cube, offset: [0, 0.06, 0]",
                "bring, object: cube, goal: over",
                "place, object: cube, target: pad",
            ),
        ],
        {Outcome.TIMEOUT},
    ),
    "wipe": Case(
        WORLDS / "wipe.yaml",
        Wipe,
        [*LONG, *at("sponge", 0.419, -0.25, 3.083), "task.command.patch.x=0.235", "task.command.patch.y=0.456"],
        {Outcome.NO_IK},
    ),
    "pour": Case(
        "pour_beads", Pour, [DEEP, *at("cup", 0.421, -0.182, 0.254), *at("tray", 0.659, 0.451, 0.0)], {Outcome.NO_IK}, 1
    ),
    "pull with a tool": Case(WORLDS / "pull_with_tool.yaml", Pull, SIDEWAYS, {Outcome.NO_IK}),
    "extract": Case(
        "peg_insertion_side",
        PullOut,
        [
            ASIDE,
            "world.layout.peg={on: table, x: 0.217, y: -0.13, yaw: {range: [2.0, 2.8]}}",
            commands("extract, object: peg, tip: peg.tip, mouth: block.mouth, offset: [0.05, 0, 0], clear: 0.3"),
        ],
        set(),
        1,
    ),
    "bring a bottle": Case(
        "dex_relocate",
        Bring,
        ["task.command.goal.x={range: [-0.2, 0.3]}", "task.command.goal.y={range: [-0.4, 0.4]}"],
        {Outcome.TIMEOUT},
        2,
    ),
}


def followed(case: Case, monkeypatch: pytest.MonkeyPatch) -> tuple[Outcome, Any, Any]:
    """How it ended, and the efforts of the grasps at first: for themselves, and with what comes next."""
    seen: list[tuple[Any, Any]] = []
    effort = LookAhead.effort

    def noted(self: LookAhead, ids: Any, rows: Any, grasps: Any, own: Any) -> Any:
        seen.append((own[0].copy(), effort(self, ids, rows, grasps, own)[0]))
        return effort(self, ids, rows, grasps, own)

    monkeypatch.setattr(LookAhead, "effort", noted)
    with make(
        case.source, engine="mujoco", overrides=["record.cameras=[]", "task.horizon=2500", *case.overrides]
    ) as env:
        env.reset(seed=case.seed)
        policy = SkillPolicy(env)
        solved = rollout(env, policy, 2500) == [Status.SUCCESS]
        outcome = Outcome.OK if solved else OUTCOMES[policy.skill.outcome[0]]
    return outcome, *seen[0]


@pytest.mark.parametrize("name", often(CASES.keys() - {"pull with a tool", "pour"}, CASES))
def test_the_grasp_is_chosen_that_can_go_on(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    outcome, own, ahead = followed(CASES[name], monkeypatch)
    assert np.isinf(ahead[np.argmin(own)]), "the nearest one does not do"
    assert np.isfinite(ahead).any()
    assert outcome is Outcome.OK


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.without])
def test_the_nearest_grasp_would_have_failed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the cases are made of: where a skill does not say what it needs, it gets stuck, but for the last rung."""
    case = CASES[name]
    monkeypatch.setattr(PhasedSkill, "_recovery", lambda self, env, failure: None)
    monkeypatch.setattr(case.follower, "wanted", MovingSkill.wanted)
    outcome, own, ahead = followed(case, monkeypatch)
    assert np.argmin(own) == np.argmin(ahead)
    assert outcome in case.without
