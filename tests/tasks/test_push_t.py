"""The overlap of outlines of push_t: known areas, and what has no outline."""

import pytest

import anysim
from anysim.errors import AnysimError
from anysim.task.scene import ObjectView
from anysim_tasks.tabletop.push_t.terms import Overlap, Overlaps
from tests.tasks.states import blind, offset, put, seen


@pytest.mark.parametrize(
    ("x", "y", "area"), [(0.0, 0.0, 0.0175), (0.02, 0.0, 0.0135), (0.0, -0.01, 0.0155), (0.4, 0, 0)]
)
def test_the_share_is_that_of_the_areas(x: float, y: float, area: float) -> None:
    """A bar of 200 x 50 and a stem of 50 x 150 mm; shifted along y, what leaves at the ends counts."""
    with blind("push_t", "null", 1, "task.command.goal.yaw=0") as env:
        env.reset(seed=0)
        put(env, "tee", offset(seen(env, "goal"), x, y))
        thing, goal = ObjectView(env.scene, "tee"), env.scene.frame("goal")
        assert Overlap(env.scene, object=thing, goal=goal)()[0] == pytest.approx(area / 0.0175, abs=0.01)
        assert Overlaps(env.scene, object=thing, goal=goal, share=0.9)()[0] == (area > 0.9 * 0.0175)


def test_a_ball_has_no_outline() -> None:
    round_ = ["world.objects.tee.source={sphere: 0.03}", "record.cameras=[]", "world.cameras.front.channels=[]"]
    with pytest.raises(AnysimError, match="more than upright boxes"):
        anysim.make("push_t", engine="null", overrides=[*round_, "world.cameras.wrist.channels=[]"])
