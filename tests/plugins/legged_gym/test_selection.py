"""Configuration: which engine is chosen, what a file says, and which robots there are."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from anysim.errors import SpecError, TaskError
from anysim_legged_gym.selection import chosen_engine, load_spec
from anysim_legged_gym.simulator import LeggedSimulator
from anysim_legged_gym.spec import LeggedSpec
from tests.plugins.legged_gym.simulators import SOFT, simulator


def test_argument_before_file_before_environment_before_default(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SIMULATOR", raising=False)
    monkeypatch.delenv("ANYSIM_ENGINE", raising=False)
    none, own = LeggedSpec(), load_spec({"simulator": {"name": "pybullet", "shards": 2}})
    assert chosen_engine(none).name == "mujoco"
    monkeypatch.setenv("ANYSIM_ENGINE", "sapien")
    assert chosen_engine(none).name == "sapien"
    monkeypatch.setenv("SIMULATOR", "null")
    assert chosen_engine(none).name == "null"
    assert chosen_engine(own) == own.simulator
    assert chosen_engine(own, "pybullet").shards == 2
    assert chosen_engine(own, "mujoco").shards == 1
    with LeggedSimulator() as sim:
        assert sim.engine.name == "null"
        assert sim.cfg.simulator is not None
        assert sim.cfg.simulator.name == "null"


def test_the_environment_is_read_when_it_is_asked_for() -> None:
    """What is set after every module was imported counts, and may change from one simulator to the next."""
    code = (
        "import os; from anysim_legged_gym.simulator import LeggedSimulator\n"
        "for name in ('null', 'no_such_engine'):\n"
        "    os.environ['SIMULATOR'] = name\n"
        "    try:\n"
        "        print(LeggedSimulator(num_envs=2).engine.name)\n"
        "    except Exception as error: print(type(error).__name__, error)\n"
    )
    environment = {**os.environ, "SIMULATOR": "isaacgym"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, env=environment)
    first, second = done.stdout.splitlines()[:2]
    assert first == "null", done.stderr
    assert second.startswith("PluginError no engine named 'no_such_engine' is installed")


def test_a_file_says_all_and_faults_have_their_place(tmp_path: Path) -> None:
    path = tmp_path / "go2.yaml"
    path.write_text(
        "simulator: 'null'\nnum_envs: 3\nasset: {robot: unitree_go2}\ncontrol:\n  stiffness: {hip: 20.0, thigh: 30.0, "
        "calf: 40.0}\n  damping: 0.5\n"
    )
    with LeggedSimulator(path, overrides=["control.action_scale=0.5"]) as sim:
        assert (sim.num_envs, sim.cfg.control.action_scale) == (3, 0.5)
        wanted = [{"hip": 20.0, "thigh": 30.0, "calf": 40.0}[name.split("_")[1]] for name in sim.dof_names]
        np.testing.assert_array_equal(sim.p_gains, wanted)
        np.testing.assert_array_equal(sim.d_gains, np.full(12, 0.5))
    path.write_text("control:\n  control_type: Q\n  decimaton: 4\n")
    with pytest.raises(SpecError) as caught:
        LeggedSimulator(path)
    assert "go2.yaml:2:17: control.control_type: expected one of P, V, T; got 'Q'" in str(caught.value)
    assert "go2.yaml:3:3: control.decimaton: unknown key; did you mean 'decimation'?" in str(caught.value)


def test_gains_by_names_that_fit_no_joint_are_refused() -> None:
    with pytest.raises(TaskError, match=r"control\.stiffness: no joint's name holds 'knee' \(joints: "):
        simulator("null", control={"stiffness": {"knee": 3.0}})
    with pytest.raises(TaskError, match=r"control\.damping says nothing of the joint '\w+_calf_joint'"):
        simulator("null", control={"damping": {"hip": 3.0, "thigh": 3.0}})
    with pytest.raises(SpecError, match=r"domain_rand\.friction: .*the least, 2, is above the most, 1"):
        simulator("null", domain_rand={"friction": [2.0, 1.0]})


def test_robots_without_legs_are_refused() -> None:
    for robot, lack in (("franka_panda", "is bolted down"), ("mobile_panda", "has no `legs` in the catalogue")):
        with pytest.raises(TaskError, match=f"robot '{robot}' cannot be simulated as a legged one: it {lack}"):
            LeggedSimulator({"asset": {"robot": robot}}, "null")
    with pytest.raises(SpecError, match="no robot named 'go9'"):
        LeggedSimulator({"asset": {"robot": "go9"}}, "null")


@pytest.mark.parametrize("robot", ["anymal_c", "solo12", "unitree_g1", "bolt"])
def test_other_legged_robots_of_the_catalogue(robot: str) -> None:
    """Steps on the engine without physics: names, sizes, and feet that stand at home."""
    with LeggedSimulator({"asset": {"robot": robot}}, "null", num_envs=2) as sim:
        sim.step(np.zeros((2, sim.num_actions)))
        sim.post_physics_step()
        assert sim.feet_pos.shape == (2, len(sim.feet_names), 3)
        assert np.ptp(sim.feet_pos[0, :, 2]) < 0.01
        assert sim.feet_pos[0, 0, 2] < 0.15
        assert sim.dof_pos_limits.shape == (sim.num_dof, 2)
        assert len(sim.dof_names) == len(set(sim.dof_names)) == sim.num_dof


def test_actions_of_another_shape_are_refused() -> None:
    with LeggedSimulator({"control": dict(SOFT)}, "null", num_envs=2) as sim:
        for wrong in (np.zeros(12), np.zeros((2, 11)), np.full((2, 12), np.nan)):
            with pytest.raises(TaskError, match=r"actions are finite numbers of the shape \(2, 12\)"):
                sim.step(wrong)
        sim.close()
        sim.close()
