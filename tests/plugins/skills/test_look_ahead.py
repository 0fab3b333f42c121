"""Looking ahead: an object is not grasped where what comes next cannot be done with any of the grasps."""

import numpy as np
import pytest

from anysim import make
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from tests.plugins.skills.test_pick import rollout

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
