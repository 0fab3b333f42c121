"""The benchmark of planners."""

import pytest

from anysim.errors import PluginError
from anysim.planning.service import default_service
from anysim.testing.engines import require_engine
from anysim_bench.plan import plan_cost
from anysim_bench.plan_costs import PlanCost


@pytest.mark.slow
@pytest.mark.full
def test_paths_are_free_and_services_answer_as_their_planner_does():
    require_engine("mujoco")
    cost = plan_cost("rrt", "pick_cube", requests=4, goals=2, engine="mujoco", pairs=3)
    assert cost.solved == cost.free == 1.0
    assert all(one.same for one in cost.services)
    assert [(one.service, one.workers) for one in cost.services] == [
        (name, workers) for name in ("processes", "threads") for workers in (1, 2)
    ]
    assert 0.0 < cost.step_p99_ms
    assert cost.pairs is not None
    assert cost.postures is not None
    assert list(cost.postures) == ["alone", "processes", "threads"]
    assert min(cost.postures.values()) > 0.0
    assert cost.pairs.reached == cost.pairs.solved == cost.pairs.free == 3
    assert cost.bare is not None, "roboplan is installed with the tools of the tests"
    assert cost.bare.solved == cost.bare.free == 1.0
    assert cost.bare.rate > 0.0
    missed_goals_are_told(cost)


def missed_goals_are_told(cost: PlanCost) -> None:
    """Of the costs with good times, and with one fault after the other."""
    good = {"ratio": 0.9, "cpu_ratio": 0.9, "bare_ratio": 0.9, "bare_cpu_ratio": 0.9, "busy_p99_ms": 11.9}
    cost = cost._replace(step_p99_ms=10.0, services=[one._replace(**good) for one in cost.services])
    assert cost.missed == []
    default, other = cost.services[0], cost.services[-1]
    assert default.service == default_service() != other.service
    assert cost.pairs is not None
    faults = {
        "2.10 ms to the 99th percentile": {"services": [default._replace(busy_p99_ms=12.1)]},
        "0.80 of its planner's rate": {"services": [default._replace(ratio=0.8, cpu_ratio=0.8)]},
        "0.80 of roboplan's rate": {"services": [default._replace(bare_ratio=0.8, bare_cpu_ratio=0.8)]},
        "answers otherwise": {"services": [other._replace(same=False)]},
        "98.0% of the paths": {"free": 0.98},
        "2 solved": {"pairs": cost.pairs._replace(solved=2)},
    }
    for said, change in faults.items():
        (sentence,) = cost._replace(**change).missed
        assert said in sentence
    assert cost._replace(services=[other._replace(busy_p99_ms=99.0)]).missed == []  # who chooses it knows
    assert cost._replace(services=[default._replace(ratio=0.5)]).missed == []  # another program had the cores


def test_a_planner_that_is_not_installed_is_refused():
    require_engine("mujoco")
    with pytest.raises(PluginError, match="no planner named 'rrrt'"):
        plan_cost("rrrt", requests=2, engine="mujoco")
