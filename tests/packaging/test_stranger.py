"""A stranger's engine: its wheel beside ours in an environment without any other backend, and all that a user does.

`tests/external/anysim-ballistic` is no member of the workspace; anysim knows it by its entry points alone.
`tests/external/anysim-broken` offers engines and commands that do not work, and must hurt nobody.
"""

import json
import re
from pathlib import Path
from typing import Any

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("wheels")]  # built once, by one worker

WORLD = """
world:
  name: two_flyers
  terrain: none
  robots:
    left: {robot: free_flyer, position: [0.0, 0.0, 2.0]}
    right: {robot: free_flyer, position: [1.0, 0.0, 2.0], yaw: 1.0}
"""

FLY = """
import anysim
import numpy as np

world = anysim.compile_world("world.yaml")
with anysim.create_simulation("ballistic", rotation_steps=2) as engine:
    engine.create_world(world, 3)
    loop, before = engine.raw_loop(), engine.get_state().body_pose
    loop(20)
    assert np.array_equal(engine.get_state().body_pose, before), "the raw loop moved the engine's own state"
    engine.set_parameters("world.gravity", [[[0.0, 0.0, 0.0]]], env_ids=[1])
    engine.set_parameters("body.mass", [[20.0]], env_ids=[2], indices=[0])
    engine.apply_wrench([10.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0], [1, 2])
    engine.step(100)
    state = engine.get_state()
    dock = engine.index.frame("left.dock")
    print(engine.version, engine.list_robots(), dock.body)
    print(*state.body_twist[:, 0, 0].round(6), *state.body_twist[:, 0, 2].round(6))
"""


class Installed:
    """A fresh environment and the programs in it."""

    def __init__(self, python: Path, program: Any, folder: Path) -> None:
        self.python, self.program, self.folder = python, program, folder

    def anysim(self, *words: str, ok: bool = True) -> Any:
        return self.program(self.python.with_name("anysim"), *words, cwd=self.folder, ok=ok)

    def json(self, *words: str, ok: bool = True) -> Any:
        return json.loads(self.anysim(*words, "--json", ok=ok).stdout)


@pytest.fixture(scope="module")
def here(environment, program, external_wheels, tmp_path_factory) -> Installed:
    """anysim, its recorder and the stranger: no backend of ours."""
    python = environment(
        "anysim",
        "anysim-collect",
        "anysim-inspect",
        "anysim-mcap",
        others=(external_wheels["anysim-ballistic"],),
        tools=("pytest",),
    )
    folder = tmp_path_factory.mktemp("work")
    (folder / "world.yaml").write_text(WORLD)
    return Installed(python, program, folder)


@pytest.fixture(scope="module")
def crowded(environment, program, external_wheels, tmp_path_factory) -> Installed:
    """The same, with a package whose engines do not work."""
    python = environment(
        "anysim",
        "anysim-collect",
        "anysim-inspect",
        "anysim-mcap",
        others=tuple(external_wheels.values()),
        tools=("pytest",),
    )
    folder = tmp_path_factory.mktemp("crowded")
    (folder / "world.yaml").write_text(WORLD)
    return Installed(python, program, folder)


# ---------------------------------------------------------------------- an engine, a robot and a task from outside


def test_it_is_listed_with_its_capabilities(here):
    rows = {row["name"]: row for row in here.json("list", "engines")}
    assert sorted(rows) == ["ballistic", "null"]
    assert rows["ballistic"] == {"name": "ballistic", "from": "anysim-ballistic", "what": "0.3.0"}
    assert re.search(r"capability\s+ballistic\s+null", here.anysim("list", "engines").stdout)


def test_its_robot_and_task_are_listed(here):
    (robot,) = here.json("list", "robots")
    assert robot["name"] == "free_flyer"
    assert robot["from"] == "anysim-ballistic"
    assert robot["what"].endswith("(Apache-2.0)")
    assert [row["name"] for row in here.json("list", "tasks")] == ["drop"]


def test_doctor_finds_it_well(here):
    rows = {row["what"]: row for row in here.json("doctor")}
    assert rows["engine: ballistic"]["state"] == "ok"
    assert rows["ballistic: physics"]["state"] == "ok"
    assert rows["ballistic: rendering"]["state"] == "absent"
    assert rows["engine: mujoco"]["remedy"] == "pip install anysim-mujoco"


def test_the_contract_suite_passes(here):
    command = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "--pyargs", "anysim.testing", "--engine", "ballistic")
    out = here.program(here.python, *command, cwd=here.folder).stdout
    found = re.search(r"anysim contract: engine ballistic 0\.3\.0: (\d+) passed, \d+ skipped \((.*)\)", out)
    assert found, out[-4000:]
    assert int(found[1]) >= 60
    undeclared = {reason.rpartition(": ")[0] for reason in found[2].split(", ")}
    assert "dynamics" not in undeclared
    assert not {reason for reason in undeclared if reason.startswith(("snapshot", "external"))}
    assert not undeclared & {f"parameter body.{name}" for name in ("mass", "com", "inertia")}


def test_it_is_chosen_by_its_string(here):
    """In a file, on the command line, by the environment, in Python; numbers come from its physics."""
    assert "ok" in here.anysim("check", "world.yaml", "--engine", "ballistic").stdout
    audit = here.json("audit", "world.yaml", "--engine", "ballistic")
    assert (audit["engine"], audit["different"]) == ("ballistic", 0)
    assert audit["compared"] >= 8
    lines = here.program(here.python, "-c", FLY, cwd=here.folder).stdout.splitlines()
    assert lines[0] == "0.3.0 (rotation_steps=2) ['left', 'right'] 0"
    # v = F t / m at the frame's origin, which lies below the centre of mass: what it turns is nothing
    pushed, fallen = [float(v) for v in lines[1].split()[:3]], [float(v) for v in lines[1].split()[3:]]
    assert pushed == pytest.approx([0.0, 10.0 * 0.2 / 10.0, 10.0 * 0.2 / 20.0], abs=1e-6)
    assert fallen == pytest.approx([-9.81 * 0.2, 0.0, -9.81 * 0.2], abs=1e-6)


def test_its_task_runs_is_recorded_and_replays_to_the_bit(here):
    summary = here.json("run", "drop", "--num-envs", "2", "--episodes", "4", "--seed", "3", "--out", "runs")
    assert summary["successes"] == summary["attempts"] == 4
    for episode in summary["episodes"]:
        out = here.anysim("replay", episode["path"]).stdout
        assert "1 of 1 replays are identical to the bit" in out


def test_worlds_it_cannot_run_are_refused_before_they_are_built(here):
    (here.folder / "box.yaml").write_text("world: {objects: {box: {source: {box: [0.1, 0.1, 0.1]}}}}\n")
    done = here.anysim("check", "box.yaml", "--engine", "ballistic", ok=False)
    assert done.returncode == 1
    refusal = "ballistic cannot run box.yaml: geom 'box.shape' collides with 'terrain' (contacts with static things)"
    assert refusal in done.stderr


def test_what_is_not_installed_comes_with_its_remedy(here):
    """The default engine is missing here, as are the tasks and robots of our own packages."""
    remedy = "no engine named 'mujoco' is installed; it comes with the package anysim-mujoco: pip install anysim-mujoco"
    for words in (["check", "world.yaml"], ["audit", "world.yaml"]):
        done = here.anysim(*words, ok=False)
        assert done.returncode != 0
        assert remedy in done.stderr
        assert "Traceback" not in done.stderr


# ---------------------------------------------------------------------- engines that do not work


def test_broken_engines_name_themselves_and_hurt_no_other(crowded):
    rows = {row["name"]: row["what"] for row in crowded.json("list", "engines")}
    assert rows["ballistic"] == "0.3.0"
    assert "No module named 'warp_drive_solver'" in rows["broken"]
    assert "anysim-broken" in rows["broken"]
    assert "the driver does not answer" in rows["unsure"]
    found = {row["what"]: row for row in crowded.json("doctor")}
    assert found["engine: ballistic"]["state"] == "ok"
    for name, cause in (("broken", "warp_drive_solver"), ("unsure", "the driver does not answer")):
        assert found[f"engine: {name}"]["state"] == "broken"
        assert cause in found[f"engine: {name}"]["found"]
        assert found[f"engine: {name}"]["remedy"]
    assert crowded.json("run", "drop", "--out", "runs")["successes"] == 1


@pytest.mark.parametrize(
    ("name", "cause"),
    [("broken", "ModuleNotFoundError: No module named 'warp_drive_solver'"), ("unsure", "the driver does not answer")],
)
def test_choosing_a_broken_engine_says_why(crowded, name, cause):
    done = crowded.anysim("run", "drop", "--engine", name, ok=False)
    assert done.returncode != 0
    assert cause in done.stderr
    assert "anysim-broken" in done.stderr
    assert "Traceback" not in done.stderr
    suite = ("-m", "pytest", "-p", "no:cacheprovider", "--pyargs", "anysim.testing", "--engine", name)
    tested = crowded.program(crowded.python, *suite, cwd=crowded.folder, ok=False)
    assert tested.returncode == pytest.ExitCode.USAGE_ERROR
    assert cause in tested.stdout + tested.stderr
    assert "INTERNALERROR" not in tested.stdout + tested.stderr


def test_broken_commands_leave_the_others_in_place(crowded):
    done = crowded.anysim("--help")
    assert "Run the experts of tasks" in done.stdout
    assert done.stderr.count("\n") == 1
    assert "the plugin 'commands' of anysim-broken does not load" in done.stderr
    assert "pip uninstall anysim-broken" in done.stderr


def test_checking_against_all_engines_goes_past_a_broken_one(crowded):
    done = crowded.anysim("check", "world.yaml", "--all-engines", ok=False)
    assert "warp_drive_solver" in done.stderr
    assert "ballistic cannot" not in done.stderr
