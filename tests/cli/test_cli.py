"""The command line as a user types it, each call in a process of its own; where bits are compared, a new Python."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from anysim import api, registry
from anysim.cli.main import app
from anysim.engine.capability import Capability
from anysim.engine.factory import runnable
from anysim.model.world import World
from anysim_schemas.load import LoadedRun
from tests import forked

FAST = ["-o", "record.cameras=[]"]


def anysim(*arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    return forked.run("-m", "anysim.cli", *arguments, cwd=cwd, timeout=900)


def anew(*arguments: str) -> subprocess.CompletedProcess[str]:
    """In a Python that is started for it, whose hashes differ, and which takes all apart at its end."""
    command = [sys.executable, "-m", "anysim.cli", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=900, check=False)


def manifests(out: Path) -> dict[str, dict[str, object]]:
    found = {}
    for path in sorted((out / "episodes").glob("*/manifest.json")):
        data = json.loads(path.read_text())
        data.pop("clock")
        found[path.parent.name] = data
    return found


def test_help_teaches() -> None:
    text = anysim("--help").stdout
    for word in ("run", "replay", "check", "list", "doctor", "audit", "compare", "schema", "bench", "Exit codes"):
        assert word in text
    assert "..." not in text.partition("Commands:")[2], "a summary is cut off"
    assert "\n    anysim run pick_cube --num-envs 16 --episodes 64 --seed 1\n" in anysim("run", "--help").stdout
    assert "\n    anysim robot import my_arm.urdf\n" in anysim("robot", "import", "--help").stdout


def test_list_names_what_is_installed() -> None:
    rows = json.loads(anysim("list", "engines", "--json").stdout)
    assert {"mujoco", "null"} <= {row["name"] for row in rows}
    assert "pick_cube" in anysim("list", "tasks", "--no-engines").stdout
    assert "franka_panda" in anysim("list", "robots").stdout
    wrong = anysim("list", "robotz")
    assert wrong.returncode == 2
    assert "did you mean 'robots'" in wrong.stderr


def test_a_wrong_task_name_says_what_exists() -> None:
    result = anysim("run", "pick_cub")
    assert result.returncode == 2
    assert "did you mean 'pick_cube'" in result.stderr
    assert "Traceback" not in result.stderr


def test_doctor_reports_every_engine() -> None:
    rows = {row["what"]: row for row in json.loads(anysim("doctor", "--json").stdout)}
    assert rows["mujoco: physics"]["state"] == "ok"
    assert rows["engine: null"]["state"] == "ok"


def test_schema_is_json() -> None:
    assert "properties" in json.loads(anysim("schema", "run").stdout)


def test_the_same_command_twice_gives_the_same_manifests_and_fewer_envs_the_same_episodes(tmp_path: Path) -> None:
    def run(name: str, count: int) -> dict[str, dict[str, object]]:
        out = tmp_path / name
        result = anew("run", "pick_cube", "-n", str(count), "-k", str(count), "-s", "1", "--out", str(out), *FAST)
        assert result.returncode == 0, result.stderr
        return manifests(out)

    first, second = run("a", 2), run("b", 2)
    assert first == second
    assert len(first) == 2
    fewer = run("c", 1)
    assert len(fewer) == 1
    for name, manifest in fewer.items():
        theirs = dict(first[name])
        for key in ("spec", "files"):  # the number of envs is in the spec, and the spec is in the file
            del manifest[key], theirs[key]
        assert manifest == theirs


def test_a_replay_in_another_process_is_identical(tmp_path: Path) -> None:
    assert anysim("run", "pick_cube", "-n", "2", "-k", "2", "--out", str(tmp_path), *FAST).returncode == 0
    result = anew("replay", str(tmp_path), "--json")
    assert result.returncode == 0, result.stderr
    report = json.loads(result.stdout)
    assert report["replayed"] == report["identical"] == 2
    elsewhere = anew("replay", str(tmp_path), "--engine", "pybullet")
    assert elsewhere.returncode == 0, elsewhere.stderr
    assert "joint_pos\t0 of 2" in elsewhere.stdout
    assert "0 of 2 replays are identical to the bit" in elsewhere.stdout


def test_a_killed_run_leaves_whole_trajectories_and_goes_on(tmp_path: Path) -> None:
    command = [
        sys.executable,
        "-m",
        "anysim.cli",
        "run",
        "pick_cube",
        "-n",
        "2",
        "-k",
        "5",
        "--out",
        str(tmp_path),
        *FAST,
    ]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    episodes = tmp_path / "episodes"
    deadline = time.monotonic() + 240
    try:
        while not (episodes.exists() and any(episodes.iterdir())) and time.monotonic() < deadline:
            time.sleep(0.02)
            assert process.poll() is None, process.communicate()[1]
        os.kill(process.pid, signal.SIGKILL)
    finally:
        process.kill()
        process.communicate()
    from anysim_inspect.verify import verify

    survived = sorted(p.name for p in episodes.iterdir())
    assert 1 <= len(survived) < 5
    assert all(verify(episodes / name) == [] for name in survived)
    result = anysim("run", "pick_cube", "-n", "2", "-k", "5", "--out", str(tmp_path), *FAST)
    assert result.returncode == 0, result.stderr
    assert f"resuming: {len(survived)} are there already" in result.stdout
    assert len(manifests(tmp_path)) == 5
    untouched = tmp_path.with_name("reference")
    assert anysim("run", "pick_cube", "-n", "2", "-k", "5", "--out", str(untouched), *FAST).returncode == 0
    assert manifests(tmp_path) == manifests(untouched), "an interrupted run ends where an uninterrupted one does"


@pytest.mark.slow
def test_eight_envs_succeed_and_replay_to_the_bit(tmp_path: Path) -> None:
    arguments = ("run", "pick_cube", "-n", "8", "-k", "8", "-s", "1", "--min-success", "0.95", "--out", str(tmp_path))
    result = anysim(*arguments)
    assert result.returncode == 0, result.stdout + result.stderr
    replayed = anysim("replay", str(tmp_path), "--json")
    assert replayed.returncode == 0, replayed.stderr
    report = json.loads(replayed.stdout)
    assert report["identical"] == report["replayed"] == 8


def test_audit_compares_every_number() -> None:
    result = anysim("audit", "pick_cube", "--json")
    assert result.returncode == 0, result.stdout + result.stderr
    report = json.loads(result.stdout)
    assert report["different"] == 0
    assert report["compared"] > 100


def test_bench_gives_a_ratio_for_each_loop() -> None:
    result = anysim("bench", "step", "-e", "mujoco", "-n", "1", "--rounds", "1", "--json")
    assert result.returncode == 0, result.stderr
    rows = json.loads(result.stdout)
    assert [(row["engine"], row["what"], row["actuation"]) for row in rows] == [
        ("mujoco", "engine", "native"),
        ("mujoco", "engine", "implicit_pd"),
        ("mujoco", "env", "implicit_pd"),
    ]
    assert all(row["ratio"] > 0 for row in rows)
    assert [row["budget"] for row in rows] == [0.90, 0.90, None]
    assert [row["missed"] for row in rows[:2]] == [row["ratio"] < 0.90 for row in rows[:2]]


def test_bench_collect_tells_the_engines_share_from_the_rest() -> None:
    arguments = ("-n", "2", "-k", "2", "--rounds", "1", "--present", "0,70", "--json")
    result = anysim("bench", "collect", "-e", "mujoco", *arguments)
    assert result.returncode == 0, result.stderr
    alone, among = json.loads(result.stdout)
    assert (alone["present"], among["present"]) == (0, 70)
    for row in (alone, among):
        assert row["steps"] > 2 * 50
        assert row["engine_share"] == row["engine_s"] / row["cpu_s"]
        assert 0.05 < row["engine_share"] < 1
        assert 0 < row["record_s"] < row["cpu_s"] - row["engine_s"]


def test_a_run_says_where_its_time_went(tmp_path: Path) -> None:
    arguments = ("run", "pick_cube", "-n", "1", "-k", "1", *FAST)
    told = anysim(*arguments, "--out", str(tmp_path / "told"))
    assert told.returncode == 0, told.stderr
    assert " steps/s" in told.stdout
    parts = ["physics", "terms", "resets", "policy", "record", "draw", "other"]
    assert [line.split("\t")[0] for line in told.stdout.splitlines() if line.split("\t")[0] in parts] == parts
    speed = json.loads(anysim(*arguments, "--out", str(tmp_path / "data"), "--json").stdout)["speed"]
    assert speed["steps"] == sum(int(str(m["steps"])) for m in manifests(tmp_path / "data").values())
    assert list(speed["where_s"]) == parts
    assert speed["where_s"]["physics"] > 0
    assert speed["where_s"]["draw"] == 0
    assert abs(sum(speed["where_s"].values()) - speed["wall_s"]) < 1e-6
    assert abs(speed["steps_per_s"] * speed["wall_s"] - speed["steps"]) < 1e-6 * speed["steps"]


def test_overrides_are_checked_like_files() -> None:
    result = anysim("run", "pick_cube", "-o", "world.objects.cube.masss=0.1")
    assert result.returncode == 2
    assert (
        "-o world.objects.cube.masss=0.1: world.objects.cube.masss: unknown key; did you mean 'mass'?" in result.stderr
    )


def test_a_command_of_a_package_that_is_not_installed_names_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    from typer.main import get_command

    from anysim.errors import PluginError

    monkeypatch.setattr(app, "registered_groups", [])  # without plugins
    group = get_command(app)
    with pytest.raises(
        PluginError, match="`anysim robot` comes with anysim-robots, which is not installed: pip install"
    ):
        group.resolve_command(group.context_class(group), ["robot", "show"])


def test_list_tasks_says_what_each_is() -> None:
    rows = {row["name"]: row for row in json.loads(anysim("list", "tasks", "--no-engines", "--json").stdout)}
    cube = rows["pick_cube"]
    assert (cube["family"], cube["horizon"], cube["expert"]) == ("tabletop", 400, "pick")
    assert cube["robots"] == ["franka_panda"]
    assert cube["levels"] == ["L0", "L1", "L2"]
    assert cube["alternates"] == ["ur5_gripper", "xarm7_gripper", "z1", "so101"]
    assert rows["put_away"]["expert"] == "commands"
    assert rows["turn_faucet"]["family"] == "contact_rich"
    assert Path(cube["picture"]).is_file()
    assert not Path(cube["picture"]).is_absolute()


def test_list_tasks_asks_the_engines_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    some, all_names, compile_world = ("pick_cube", "pour_beads", "put_away"), registry.names, api.compile_world
    asked: list[object] = []

    def compiled(loaded: LoadedRun) -> World:
        asked.append(loaded)
        return compile_world(loaded)

    monkeypatch.setenv("ANYSIM_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(registry, "names", lambda kind: some if kind == "tasks" else all_names(kind))
    monkeypatch.setattr(api, "compile_world", compiled)
    first, second = (CliRunner().invoke(app, ["list", "tasks", "--json"]).stdout for _ in range(2))
    assert len(asked) == len(some)
    assert first == second
    rows = {row["name"]: row for row in json.loads(first)}
    assert list(rows) == list(some)
    assert set(rows["pick_cube"]["engines"]) == set(runnable(Capability.DYNAMICS)), "null has no physics"
