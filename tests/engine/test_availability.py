"""Versions that are known to be bad are refused with the reason and the remedy, on every backend."""

import importlib
import importlib.util
from importlib import metadata
from typing import ClassVar

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

from anysim.engine import availability
from anysim.engine.availability import LibraryRequirement
from anysim.engine.factory import create_simulation
from anysim.engine.options import EngineOptions
from anysim.errors import EngineError

BAD = [
    ("mujoco", "4.0.0", "its sparse solver is wrong where articulated bodies touch"),
    ("mujoco", "3.16.2", "has no mujoco.batch"),
    ("pybullet", "3.2.6", "older than 3.2.7"),
    ("sapien", "3.0.2", "older than 3.0.3"),
    ("sapien", "2.2.2", "older than 3.0.3"),
    ("mujoco", "", "the package mujoco is not installed"),
    ("pybullet", "", "the package pybullet is not installed"),
    ("sapien", "", "the package sapien is not installed"),
]


@pytest.mark.parametrize(("engine", "version", "cause"), BAD)
def test_a_bad_version_is_refused_with_its_remedy(monkeypatch, engine, version, cause):
    declared = pytest.importorskip(f"anysim_{engine}.declared")
    monkeypatch.setattr(availability, "installed_version", lambda _: version)
    with pytest.raises(EngineError, match=rf"engine '{engine}' cannot run here: .*{cause}.*pip install"):
        create_simulation(engine)
    (command,) = [word for word in declared.LIBRARY.remedy.split("'") if engine in word]
    allowed = Requirement(command).specifier
    assert not version or version not in allowed, "the remedy allows the version that it is to replace"


@pytest.mark.parametrize(("engine", "version"), [("mujoco", "3.17.0"), ("pybullet", "3.2.7"), ("sapien", "3.0.3")])
def test_the_oldest_good_version_is_taken(monkeypatch, engine, version):
    declared = pytest.importorskip(f"anysim_{engine}.declared")
    monkeypatch.setattr(availability, "installed_version", lambda _: version)
    assert declared.LIBRARY.availability() == (True, version, (), "")


@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
def test_remedy_and_dependency_agree(engine):
    """What pip installs beside the backend is what the backend accepts."""
    declared = importlib.import_module(f"anysim_{engine}.declared") if _here(engine) else pytest.skip("not installed")
    (needed,) = [r for r in map(Requirement, metadata.requires(f"anysim-{engine}") or ()) if r.name == engine]
    (command,) = [word for word in declared.LIBRARY.remedy.split("'") if engine in word]
    assert Requirement(command).specifier == needed.specifier
    oldest = SpecifierSet(f">={'.'.join(map(str, declared.LIBRARY.minimum)).removesuffix('.0')}")
    assert set(oldest) <= set(needed.specifier)


def _here(engine):
    return importlib.util.find_spec(f"anysim_{engine}") is not None


LIB = LibraryRequirement("lib", (3, 1), "is old", "pip install lib", {(4, 0, 0): "wrong"})


@pytest.mark.parametrize("version", ["4.0", "4.0.0", "4.0.0rc1", "4.0.0.post1"])
def test_spellings_of_a_bad_version(version):
    assert not LIB.judge(version).available


@pytest.mark.parametrize(("version", "good"), [("3.0.9", False), ("3.1", True), ("3.10.2", True), ("4.0.1", True)])
def test_versions_are_numbers(version, good):
    assert LIB.judge(version).available is good


def test_a_library_without_a_wheel_says_so(monkeypatch):
    monkeypatch.setattr(availability.sys, "platform", "linux")
    monkeypatch.setattr(availability.platform, "machine", lambda: "riscv64")
    some = LibraryRequirement("lib", (1,), "is old", "pip install lib", machines=("x86_64",))
    assert some.judge("").missing == ("the package lib is not installed and has no wheel for riscv64",)
    assert LIB.judge("").missing == ("the package lib is not installed",)


def test_options_that_shape_trajectories_are_stamped():
    class Options(EngineOptions):
        shaping: ClassVar[tuple[str, ...]] = ("sweeps", "residual")
        residual: float = 1e-7
        sweeps: int = 50
        shadows: bool = False

    assert Options(shadows=True).trajectory_stamp() == ""
    assert Options(residual=1e-3, sweeps=7).trajectory_stamp() == "sweeps=7,residual=0.001"
    with pytest.raises(ValueError, match="extra"):
        Options.model_validate({"sweep": 3})
