"""Measurements of robots whose files come with a package that is not installed everywhere."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

from anysim.assets.catalogue import load_robot
from anysim_robots.gallery.store import Stored, due, fingerprint, measure, package, read
from anysim_robots.qualify.run import Durations

ROOT = Path(__file__).parents[3]
ARM = ROOT / "tests" / "external" / "anysim-thirdarm" / "anysim_thirdarm"
SHORT = Durations(0.2, 0.1, 0.1)


@pytest.fixture
def name(tmp_path: Path) -> str:
    """The stranger's arm, its URDF in a package that is not there yet."""
    text = (ARM / "third_arm.yaml").read_text()
    text = text.replace("source: third_arm.urdf", "source: package:nice_models/third_arm.urdf\nneeds: nice-models")
    (tmp_path / "third_arm.yaml").write_text(text)
    return str(tmp_path / "third_arm.yaml")


def install(monkeypatch: pytest.MonkeyPatch, folder: Path, version: str) -> None:
    """The package with the URDF, and what pip writes beside it; also for other processes."""
    (folder / "nice_models").mkdir(parents=True)
    (folder / "nice_models" / "third_arm.urdf").write_text((ARM / "third_arm.urdf").read_text())
    (folder / f"nice_models-{version}.dist-info").mkdir()
    (folder / f"nice_models-{version}.dist-info" / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: nice-models\nVersion: {version}\n"
    )
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.setenv("PYTHONPATH", str(folder))


def test_the_version_decides_whether_it_is_measured_again(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    row = {"digest": fingerprint(load_robot(name)), "durations": list(SHORT), "engines": {"mujoco": {}}}
    absent: Stored = {"robots": {name: row}}
    with_one: Stored = {"robots": {name: row | {"package": "nice-models 1.0"}}}
    again = [(name, "mujoco")]
    assert package(load_robot(name)) == ""
    assert due(absent, [name], ["mujoco"], SHORT) == due(with_one, [name], ["mujoco"], SHORT) == []
    with monkeypatch.context() as patch:
        install(patch, tmp_path / "one", "1.0")
        assert package(load_robot(name)) == "nice-models 1.0"
        assert due(with_one, [name], ["mujoco"], SHORT) == []
        assert due(absent, [name], ["mujoco"], SHORT) == again
    with monkeypatch.context() as patch:
        install(patch, tmp_path / "two", "2.0")
        assert due(with_one, [name], ["mujoco"], SHORT) == again


@pytest.mark.slow
def test_what_was_measured_with_it_stays_without_it(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = tmp_path / "robots.json"
    measure(store, [name], ["mujoco"], SHORT)
    assert read(store)["robots"]["third_arm"]["engines"]["mujoco"]["status"] == "absent"
    assert "package" not in read(store)["robots"]["third_arm"]
    with monkeypatch.context() as patch:
        install(patch, tmp_path / "one", "1.0")
        stored = read(store)
        stored["robots"][name] = stored["robots"].pop("third_arm")
        assert due(stored, [name], ["mujoco"], SHORT), "its files are there now"
        measure(store, [name], ["mujoco"], SHORT)
    row = read(store)["robots"]["third_arm"]
    assert (row["engines"]["mujoco"]["status"], row["package"]) == ("qualified", "nice-models 1.0")
    assert due({"robots": {name: row}}, [name], ["mujoco"], SHORT) == []


@pytest.fixture
def script() -> ModuleType:
    """scripts/robot_table.py, which is no package."""
    spec = importlib.util.spec_from_file_location("robot_table", ROOT / "scripts" / "robot_table.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_table_says_which_versions_were_measured_and_keeps_them(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the package hidden: the check has nothing against a row from elsewhere, and measuring leaves it alone."""
    find = importlib.util.find_spec
    hidden = "gym_aloha"
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *of: None if name == hidden else find(name, *of))
    monkeypatch.setattr(script, "catalogue", lambda: ["aloha", "ur5"])
    row = {"digest": fingerprint(load_robot("aloha")), "engines": dict.fromkeys(script.ENGINES)}
    stored: Stored = {
        "robots": {
            "aloha": {**row, "package": "gym-aloha 0.1.5"},
            "ur5": {**row, "digest": fingerprint(load_robot("ur5"))},
        }
    }
    assert script.faults(stored) == []
    assert script._left(stored, "aloha")
    assert not script._left(stored, "ur5")
    assert script._packages(stored["robots"])[0].endswith("were measured with gym-aloha 0.1.5 (aloha).")
    stored["robots"]["aloha"]["digest"] = "another"
    (fault,) = script.faults(stored)
    assert "aloha is not what was measured" in fault
    assert "pip install 'gym-aloha'" in fault
    del stored["robots"]["aloha"]["package"]
    assert not script._left(stored, "aloha"), "a row without figures may be written anew"


def test_a_package_of_the_test_does_not_stay() -> None:
    assert "nice_models" not in sys.modules
    assert importlib.util.find_spec("nice_models") is None
