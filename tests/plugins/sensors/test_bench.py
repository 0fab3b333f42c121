"""`anysim bench sensors`: it joins the group, and its figures are told with their goals."""

import json

import pytest
from typer.testing import CliRunner

from anysim.cli import main
from anysim_sensors.bench import SensorCost, sensor_costs
from anysim_sensors.step_bench import SENSORS, step_costs


@pytest.mark.slow
def test_all_figures_are_measured() -> None:
    costs = sensor_costs(geoms=20, rounds=1)
    assert len(costs) == 10
    assert all(cost.value > 0 for cost in costs)
    assert len({cost.what for cost in costs}) == 10


@pytest.mark.slow
def test_each_sensor_has_its_share_of_a_control_step() -> None:
    costs = step_costs(rounds=1)
    assert len(costs) == 1 + 2 * len(SENSORS)
    assert all(cost.value > 0 for cost in costs)


def test_a_missed_goal_is_marked() -> None:
    assert SensorCost("rays", 2.9, "M/s", 3.0).words == "3 missed"
    assert SensorCost("rays", 3.1, "M/s", 3.0).words == "3"
    assert SensorCost("taxels", 21.0, "us", 20.0, True).words == "20 missed"
    assert SensorCost("taxels", 19.0, "us", 20.0, True).words == "20"
    assert SensorCost("grid", 1.0, "ms").words == ""


@pytest.mark.slow
def test_the_command_stands_in_the_group_of_benchmarks(monkeypatch: pytest.MonkeyPatch) -> None:
    """The group is made by another distribution, and joined by this one."""
    monkeypatch.setattr(
        "anysim_sensors.bench.sensor_costs", lambda geoms, rounds: [SensorCost("rays", geoms, "M/s", 3.0)]
    )
    monkeypatch.setattr(
        "anysim_sensors.step_bench.step_costs", lambda rounds: [SensorCost("lidar", rounds, "times", 1.25, True)]
    )
    main._join_commands()
    done = CliRunner().invoke(main.app, ["bench", "sensors", "--geoms", "7", "--json"])
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout) == [
        {"what": "rays", "value": 7, "unit": "M/s", "goal": 3.0, "less": False, "missed": False},
        {"what": "lidar", "value": 5, "unit": "times", "goal": 1.25, "less": True, "missed": True},
    ]
