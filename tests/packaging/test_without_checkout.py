"""anysim without its repository: wheels, extras and the guides' package in a fresh environment, on three engines."""

import json
import sys
from pathlib import Path
from typing import Any

import pytest
from checks.constraints import FILE as CONSTRAINTS
from lock import find_uv

from anysim.testing.engines import require_engine
from tests.external_packages import FOUND, offered
from tests.tiers import in_turn

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("wheels")]  # built once, by one worker

ROOT = Path(__file__).parents[2]
ENGINES = ("mujoco", "pybullet", "sapien")
EXTRAS = (*ENGINES, "mcap", "tasks")
OWN_TASK = """
physics: {dt: 0.002, control_dt: 0.02, impratio: 10.0}
num_envs: 2
world:
  name: lift_the_can
  terrain: plane
  robots:
    arm:
      robot: franka_panda
      position: [-0.1, 0.0, 0.4]
      actions: {arm: {controller: joint_delta_position, params: {scale: 0.06}}, eef: gripper_binary}
  objects:
    bench: {source: {box: [1.1, 1.4, 0.4]}, fixed: true, friction: 0.8}
    block: {source: {box: [0.04, 0.04, 0.05]}, mass: 0.12, friction: {range: [0.7, 1.0]}}
  layout:
    bench: {position: [0.3, 0.0, 0.2]}
    block: {on: bench, x: {range: [0.28, 0.42]}, y: {range: [-0.15, 0.15]}, yaw: {range: [-1.0, 1.0]}}
task:
  horizon: 400
  command: {goal: {term: goal_above, surface: bench, x: 0.05, y: 0.0, height: {range: [0.1, 0.2]}}}
  observations: {policy: [joint_pos, joint_vel, {term: goal_position, goal: goal}]}
  rewards: {reach: {term: tanh_distance, a: arm.tool, b: block, scale: 0.2, weight: 1.0}}
  success: {near: {term: near, a: block, b: goal, tolerance: 0.025}, rest: {term: at_rest, robot: arm, speed: 0.2}}
  expert: {skill: pick, robot: arm, object: block, goal: goal}
record: {writer: mcap}
"""
ORIGIN = "import anysim, anysim_tasks; print(anysim.__file__); print(anysim_tasks.__file__)"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A working directory far from the checkout."""
    place = tmp_path_factory.mktemp("elsewhere")
    (place / "own.yaml").write_text(OWN_TASK)
    return place


@pytest.fixture(scope="module")
def python(
    wheels: list[Path], external_wheels: dict[str, Path], program: Any, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """An environment with the extras, installed as docs/install.md says, and the package that the guides write."""
    program(ROOT / "scripts" / "wheel_list.sh", wheels[0].parent)
    uv, venv = find_uv(ROOT), tmp_path_factory.mktemp("user") / "venv"
    program(uv, "venv", "--quiet", "--python", sys.executable, venv)
    own = ("--constraint", wheels[0].parent / "anysim.txt", "--constraint", ROOT / CONSTRAINTS)
    interpreter = venv / "bin" / "python"
    wanted = f"anysim[{','.join(EXTRAS)}]", external_wheels["anysim-starter"]
    program(uv, "pip", "install", "--quiet", "--python", interpreter, "--compile-bytecode", *own, *wanted, cwd=venv)
    program(uv, "pip", "check", "--python", interpreter)
    return interpreter


def test_nothing_of_the_checkout_is_on_the_path(python: Path, program: Any, folder: Path) -> None:
    places = program(python, "-c", ORIGIN, cwd=folder).stdout.splitlines()
    assert len(places) == 2
    assert all(Path(place).is_relative_to(python.parents[1]) for place in places)
    installed = {
        row["name"]
        for row in json.loads(program(python.with_name("anysim"), "list", "engines", "--json", cwd=folder).stdout)
    }
    assert installed == {"null", *ENGINES}


def test_all_that_the_package_of_the_guides_offers_is_found_and_loads(python: Path, program: Any, folder: Path) -> None:
    found = program(python, "-c", FOUND, "anysim-starter", cwd=folder).stdout
    assert json.loads(found) == offered("anysim-starter")


@pytest.mark.parametrize(("task", "engine"), in_turn(["pick_cube", "own.yaml", "touch_shelf"]))
def test_a_task_runs_and_is_recorded(task: str, engine: str, python: Path, program: Any, folder: Path) -> None:
    require_engine(engine)
    out = folder / f"{Path(task).stem}-{engine}"
    words = (
        "run",
        task,
        "--engine",
        engine,
        "-n",
        "2",
        "-k",
        "2",
        "-s",
        "3",
        "-o",
        "record.cameras=[]",
        "--out",
        out,
        "--json",
    )
    summary = json.loads(program(python.with_name("anysim"), *words, cwd=folder).stdout)
    assert summary["attempts"] == summary["successes"] == 2
    for episode in summary["episodes"]:
        assert (Path(episode["path"]) / "trajectory.mcap").stat().st_size > 10_000


def test_its_commands_are_planned_and_replay(python: Path, program: Any, folder: Path) -> None:
    """Skills as commands, and a planner, of the package of the guides."""
    words = ("-n", "4", "-k", "8", "--seed", "5", "-o", "record.cameras=[]", "--out", "touch_twice", "--json")
    found = json.loads(program(python.with_name("anysim"), "run", "touch_twice", *words, cwd=folder).stdout)
    assert found["successes"] == found["attempts"] == 8
    assert {episode["outcome"]["phase"] for episode in found["episodes"]} == {"2 starter_plan_to: follow"}
    again = json.loads(program(python.with_name("anysim"), "replay", "touch_twice", "--json", cwd=folder).stdout)
    assert again["identical"] == again["replayed"] == 8
