"""The benchmark of planners."""

import pytest

from anysim.errors import PluginError
from anysim.testing.engines import require_engine
from anysim_bench.plan import plan_cost


@pytest.mark.slow
def test_paths_are_free_and_services_answer_as_their_planner_does():
    require_engine("mujoco")
    cost = plan_cost("rrt", "pick_cube", requests=4, goals=2, engine="mujoco", pairs=3)
    assert cost.solved == cost.free == 1.0
    assert not [sentence for sentence in cost.missed if "goal" not in sentence and "the most" not in sentence]
    assert [(one.service, one.workers) for one in cost.services] == [
        (name, workers) for name in ("processes", "threads") for workers in (1, 2)
    ]
    assert 0.0 < cost.step_p99_ms
    assert cost.pairs is not None
    assert cost.postures is not None
    assert list(cost.postures) == ["alone", "processes", "threads"]
    assert min(cost.postures.values()) > 0.0
    assert cost.pairs.reached == cost.pairs.solved == cost.pairs.free == 3


def test_a_planner_that_is_not_installed_is_refused():
    require_engine("mujoco")
    with pytest.raises(PluginError, match="no planner named 'rrrt'"):
        plan_cost("rrrt", requests=2, engine="mujoco")
