"""The skills with a scoop: where the hand is for an edge, and what they say of a bed without grains."""

import numpy as np

from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.task.scene import ObjectView
from anysim_matter.held_scoop import HeldScoop
from anysim_skills.arm import Arm
from tests.tasks.matter_paths import particles, put_particles
from tests.tasks.states import blind, seen

SMALL = "world.families.sand.box=[0.03, 0.03, 0.03]"
COMMAND = "collect.commands=[{do: scoop, scoop: scoop, source: sandbox, contents: sand, front: 0.04}]"


def test_a_scoop_is_placed_by_its_front_edge_and_an_empty_bed_is_refused() -> None:
    with blind("scoop_sand", "mujoco", 1, SMALL, COMMAND) as env:
        env.reset(seed=3)
        env.scene.look(None)
        scoop, robot = ObjectView(env.scene, "scoop"), env.scene.robot("panda")
        held = HeldScoop(Arm.of(env, robot), scoop, env.scene.category("sand"), 0.04)
        one = np.arange(1)
        held.take(one, one)
        heading, edge = np.array([[0.3, -1.2]]), np.array([[[0.4, 0.1, 0.5], [0.5, 0.0, 0.6]]])
        tools = held.tools(one, heading, edge, 0.5)
        grip = P.compose(P.inverse(seen(env, "scoop")), seen(env, "panda.tool"))
        placed = P.compose(tools, P.inverse(np.broadcast_to(grip[:, None], tools.shape)))
        front = P.rotate(placed[..., 3:], np.broadcast_to([1.0, 0.0, 0.0], edge.shape))
        assert np.allclose(placed[..., :3] + 0.04 * front, edge, atol=1e-9)
        assert np.allclose(front[..., 2], -np.sin(0.5), atol=1e-9)  # its front is down
        assert np.allclose(np.arctan2(front[..., 1], front[..., 0]), heading, atol=1e-9)
        inside = offset_grid(seen(env, "scoop")[0, :3], particles(env, "sand").x.shape[1])
        put_particles(env, "sand", inside[None])
        assert held.loaded(one, one).tolist() == [len(inside)]
        policy = SkillPolicy(env)
        policy.begin(one)
        env.step(policy.act(one))
        assert OUTCOMES[policy.skill.outcome[0]] is Outcome.ADVERSE_STATE  # all of them are in the scoop


def offset_grid(place: np.ndarray, count: int) -> np.ndarray:
    """(count, 3) [m] places near each other above the bottom of a scoop that lies level."""
    return place + np.array([0.0, 0.0, 0.01]) + 1e-3 * np.random.default_rng(0).uniform(-1, 1, (count, 3))
