"""The velocity env: shapes, determinism, rewards and levels; the tensors' view; the benchmark."""

import importlib.util
import json
import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from anysim.cli import main
from anysim.errors import PluginError, TaskError
from anysim.testing.engines import require_engine
from anysim_legged_gym.bench import LeggedCost, legged_cost
from anysim_legged_gym.simulator import LeggedSimulator
from anysim_legged_gym.tensors import TensorView
from anysim_legged_gym.velocity import VelocityEnv
from tests.plugins.legged_gym.simulators import simulator

TILES: dict[str, Any] = {
    "mesh_type": "heightfield",
    "ground": {"kind": "tiles", "tiles": {"rows": 3, "size": 4.0, "choose": "curriculum", "start": 0}},
}


def test_an_env_does_not_depend_on_how_many_there_are() -> None:
    found = []
    for count in (2, 3):
        with simulator("mujoco", count, domain_rand={"kp_scale": [0.9, 1.1]}, seed=4) as sim:
            env, draws, rows = VelocityEnv(sim, episode=0.3), np.random.default_rng(0), []
            for _ in range(20):
                made = env.step(draws.normal(size=(3, 12))[:count])
                rows.append((made.observation[:2], made.reward[:2], made.done[:2], env.commands[:2].copy()))
            found.append(rows)
    for one, other in zip(*found, strict=True):
        for a, b in zip(one, other, strict=True):
            np.testing.assert_array_equal(a, b)
    assert one[0].shape == (2, 50)
    assert one[0].dtype == np.float32
    assert sum(row[2].any() for row in found[0]) >= 1, "an episode of 15 actions ended"


def test_standing_still_pays_where_standing_is_commanded_and_a_fall_ends() -> None:
    with simulator("mujoco", 4) as sim:
        env = VelocityEnv(sim)
        env.commands[:] = [[0, 0, 0], [0, 0, 0], [1, 0, 0], [0, 0, 1]]
        for _ in range(20):
            made = env.step(np.zeros((4, 12)))
        assert not made.done.any()
        assert made.reward[0] > 0.1
        assert made.reward[2] < made.reward[0] - 0.05
        assert made.reward[3] < made.reward[0] - 0.03
        upside_down = [[1.0, 0.0, 0.0, 0.0]]
        sim.reset_root_states([1], [[0.0, 0.0, 0.5]], upside_down, np.zeros((1, 3)), np.zeros((1, 3)))
        made = env.step(np.zeros((4, 12)))
        np.testing.assert_array_equal(made.done, [False, True, False, False])
        assert not made.late.any()
        assert made.reward[1] < made.reward[0] - 0.4
        np.testing.assert_allclose(sim.base_pos[1], sim.base_init_pos, atol=1e-9)


def test_levels_follow_what_was_walked() -> None:
    with simulator("null", 4, terrain=TILES) as sim:
        env = VelocityEnv(sim, episode=0.1, heights=True)
        assert env.observation.shape == (4, 50 + 187)
        assert (sim.terrain_levels == 0).all()
        sim.ground.levels[:] = 1
        sim.reset_idx(np.arange(4))
        env.commands[:] = [[1, 0, 0], [1, 0, 0], [0, 0, 0], [0, 0, 0]]
        place = sim.env_origins + sim.base_init_pos
        place[0, 0] += 2.1
        turns, still = np.tile([0.0, 0.0, 0.0, 1.0], (4, 1)), np.zeros((4, 3))
        sim.reset_root_states(np.arange(4), place, turns, still, still)
        for _ in range(5):
            made = env.step(np.zeros((4, 12)))
        assert made.late.all()
        np.testing.assert_array_equal(sim.terrain_levels, [2, 0, 1, 1])


@pytest.mark.parametrize("robot", ["solo12", "anymal_c"])
def test_diagonal_feet_stand_together(robot: str) -> None:
    """Front left with hind right, whatever a robot calls them; and hips are what turns about x."""
    with LeggedSimulator({"asset": {"robot": robot}}, "null") as sim:
        env = VelocityEnv(sim)
        env.step(np.zeros((1, 12)))
        phase = dict(zip((name[:2] for name in sim.feet_names), env._phase()[0], strict=True))
        left, right = ("HL", "HR") if robot == "solo12" else ("RL", "RR")
        assert phase["FL"] == phase[right] == pytest.approx(sim.dt * 2.5)
        assert phase["FR"] == phase[left] == pytest.approx(sim.dt * 2.5 + 0.5)
        assert [sim.dof_names[i][-3:] for i in env._hips] == ["HAA"] * 4


def test_a_trot_needs_four_feet() -> None:
    with LeggedSimulator({"asset": {"robot": "bolt"}}, "null") as sim, pytest.raises(TaskError, match="four feet"):
        VelocityEnv(sim)


def test_tensors_are_copies_in_single_precision(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a stand-in for torch that keeps what it is given, where torch is not installed."""
    if importlib.util.find_spec("torch") is None:
        fake: Any = ModuleType("torch")
        fake.from_numpy = lambda array: SimpleNamespace(numpy=lambda: array)
        monkeypatch.setitem(sys.modules, "torch", fake)
    with simulator("null") as sim:
        view = TensorView(sim)
        tensor = view.dof_pos.numpy()
        assert tensor.dtype == np.float32
        np.testing.assert_allclose(tensor, sim.dof_pos, atol=1e-6)
        tensor[:] = 7.0
        assert sim.dof_pos.max() < 2.0
        assert view.num_envs == 2
        assert view.feet_indices.numpy().dtype.kind == "i"
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(PluginError, match=r"tensors need torch.*pip install torch"):
        TensorView(sim)


@pytest.mark.slow
def test_the_benchmark_measures_all_of_it() -> None:
    require_engine("mujoco")
    cost = legged_cost("mujoco", 8, rounds=1)
    assert min(cost.raw, cost.simulator, cost.env) > 0
    assert cost.ratio == pytest.approx(cost.env / cost.raw)
    assert 0 < cost.heights < 1000
    assert cost.level > 0


@pytest.mark.slow
def test_the_command_stands_in_the_group_of_benchmarks(monkeypatch: pytest.MonkeyPatch) -> None:
    """The group is made by another distribution, and joined by this one; a goal that is missed is marked."""
    made = LeggedCost("mujoco", 256, 100.0, 90.0, 50.0, 0.5, 0.5, 1.0, 2.0)
    monkeypatch.setattr("anysim_legged_gym.bench.legged_cost", lambda *_: made)
    main._join_commands()
    result = CliRunner().invoke(main.app, ["bench", "legged", "--engines", "mujoco"])
    assert result.exit_code == 0, result.output
    assert "0.6 missed" in result.output
    found = json.loads(CliRunner().invoke(main.app, ["bench", "legged", "-e", "mujoco", "--json"]).output)
    assert (found[0]["env"], found[0]["missed"]) == (50.0, True)
    assert not made._replace(ratio=0.61).missed
