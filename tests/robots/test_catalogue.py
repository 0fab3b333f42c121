"""Every robot of the catalogue: the entry is sound, and what its measurement promises holds."""

import json
import math
import re
from functools import cache
from pathlib import Path

import pytest

from anysim import registry
from anysim.api import load
from anysim.assets.catalogue import CatalogueEntry, load_robot, missing_source
from anysim.compile.world import compile_with_report
from anysim.model.world import World
from anysim_robots.qualify.run import Durations, qualify
from anysim_robots.qualify.stage import NAME, controllers, stage

ROBOTS = [n for n in registry.names("robots") if registry.distribution("robots", n) == "anysim-robots"]
ENGINES = ("mujoco", "pybullet", "sapien")
STORE = Path(__file__).parents[2] / "docs" / "robots.json"
CHANNELS = {"base", "arm", "eef"}
NON_COMMERCIAL = re.compile(r"(?<![A-Za-z])NC(?![A-Za-z])|non-?commercial|research only", re.IGNORECASE)
SHORT = Durations(hold=1.0, random=0.4, replay=0.4)

robots = pytest.mark.parametrize("name", ROBOTS)


@cache
def entry(name: str) -> CatalogueEntry:
    return load_robot(name)


def world(name: str) -> World:
    absent = missing_source(entry(name))
    if absent:
        pytest.skip(f"{name}: {absent}")
    return compile_with_report(load(stage(entry(name), ground=False)).spec).world


def test_the_catalogue_is_there() -> None:
    assert {"franka_panda", "unitree_go1"} <= set(ROBOTS)


@robots
def test_the_licence_is_stated_and_allows_use(name: str) -> None:
    spec = entry(name).spec
    for holder in (spec, *spec.parts):
        assert holder.license.strip()
        assert holder.license_source.strip()
        assert "TODO" not in f"{holder.license} {holder.license_source}"
        assert not NON_COMMERCIAL.search(holder.license), holder.license


@robots
def test_a_source_that_is_not_here_says_what_to_install(name: str) -> None:
    absent = missing_source(entry(name))
    if absent:
        assert entry(name).spec.needs, f"{name}: {absent}; the entry lacks `needs`"
        assert f"pip install '{entry(name).spec.needs}'" in absent


@robots
def test_the_name_is_that_of_its_file_and_channels_have_the_usual_ones(name: str) -> None:
    spec = entry(name).spec
    assert spec.name == name == entry(name).file.stem
    assert spec.category == "camera" or spec.channels
    assert set(spec.channels) <= CHANNELS
    assert all(re.fullmatch(r"[A-Za-z]\w*", n) for n in (*spec.channels, *spec.tools, *spec.sensors))
    if spec.base == "floating" and spec.category != "camera":
        assert not spec.gravity_compensation, "the engine would hold it up from outside"


@robots
def test_the_controllers_of_its_channels_exist(name: str) -> None:
    known = registry.names("controllers")
    for channel, spec in entry(name).spec.channels.items():
        for controller in spec.controllers:
            assert controller in known, f"{name}.{channel}: no controller '{controller}' is installed ({known})"
    assert set(controllers(entry(name).spec)) == set(entry(name).spec.channels)


@robots
def test_it_compiles_and_home_is_inside_its_limits(name: str) -> None:
    built = world(name)
    robot = built.robots[0]
    for joint in built.joints:
        slack = 1e-6 if joint.mimic is None else 1e-3
        assert joint.lower - slack <= joint.initial <= joint.upper + slack, joint.name
    for channel in robot.channels.values():
        for joint, actuator in zip(channel.joints, channel.actuators, strict=True):
            drive = built.actuators[actuator]
            assert math.isfinite(drive.effort_limit), f"{built.joints[joint].name} has no effort limit"
            assert drive.effort_limit > 0
    assert sorted(robot.tools) == sorted(entry(name).spec.tools)
    assert len(built.entities) == 1
    assert built.entities[0].name == NAME


# ---------------------------------------------------------------------- on the engines


def measured(name: str, engine: str) -> dict[str, str] | None:
    """The checks that docs/robots.json says it fails, with the cause; None where it is not qualified there at all."""
    row = json.loads(STORE.read_text())["robots"].get(name)
    if row is None or engine not in row["engines"]:
        return {}
    found = row["engines"][engine]
    if found["status"] in ("absent", "refused"):
        return None
    return {check["name"]: check["words"] for check in found["checks"] if check["passed"] is False}


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@robots
def test_it_qualifies_on_the_engine(name: str, engine: str) -> None:
    absent = missing_source(entry(name))
    if absent:
        pytest.skip(f"{name}: {absent}")
    known = measured(name, engine)
    if known is None:
        pytest.skip(f"docs/robots.json: {name} is not for {engine}")
    found = qualify(name, engine, SHORT)  # in this process: starting one for each would take most of the time
    unknown = [check.told for check in found.failed if check.name not in known]
    assert not unknown, f"{unknown} (known: {known})"
    assert found.status in ("qualified", "failed")


def test_what_misses_a_check_says_why() -> None:
    for name, row in json.loads(STORE.read_text())["robots"].items():
        for engine, found in row["engines"].items():
            for check in found["checks"]:
                assert check["passed"] is not False or check["words"], f"{name} on {engine}: {check['name']}"
            assert found["status"] in ("qualified", "failed") or found["why"], f"{name} on {engine}"
