"""Requirements of a run: what it changes per env is known, and refused, before an engine builds anything."""

from typing import ClassVar

import pytest

from anysim.api import check_engine, compile_world, load, make
from anysim.engine.kinematic import NullEngine
from anysim.errors import CapabilityError

YAML = """\
engine: mujoco
world:
  objects:
    cube:
      source: {box: [0.1, 0.1, 0.1]}
      mass: {range: [0.1, 0.2]}
      friction: {range: [0.2, 0.6]}
  layout:
    cube: {position: [0.0, 0.0, 0.05]}
"""


class Rigid(NullEngine):
    """Can change masses, and no surface."""

    name = "rigid"
    parameters: ClassVar[frozenset[str]] = frozenset({"body.mass", "body.inertia"})

    def _build(self, world, num_envs):
        raise AssertionError("it was built")


def test_a_draw_that_the_engine_cannot_make_is_refused_by_field_line_and_engine(tmp_path) -> None:
    path = tmp_path / "cube.yaml"
    path.write_text(YAML)
    loaded = load(path)
    with pytest.raises(CapabilityError) as caught:
        check_engine(loaded, compile_world(loaded), Rigid, "cube.yaml")
    text = str(caught.value)
    assert "rigid cannot run cube.yaml: world.objects.cube.friction" in text
    assert "cube.yaml:7:17) differs between envs, and rigid cannot change 'geom.friction' per env" in text
    assert "mass" not in text


def test_make_refuses_before_the_build(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "cube.yaml"
    path.write_text(YAML)
    monkeypatch.setattr("anysim.api.simulation", lambda spec: Rigid())
    with pytest.raises(CapabilityError, match=r"cube\.yaml:7:17"):
        make(path)


def test_what_the_engine_can_change_is_taken(tmp_path) -> None:
    path = tmp_path / "cube.yaml"
    path.write_text(YAML)
    loaded = load(path, overrides=["world.objects.cube.friction=0.5"])
    check_engine(loaded, compile_world(loaded), Rigid, "cube.yaml")


def test_a_joint_that_rubs_anew_in_each_episode_is_refused_too(tmp_path) -> None:
    path = tmp_path / "cabinet.yaml"
    path.write_text(
        "world:\n"
        "  objects:\n"
        "    cabinet:\n"
        "      source: procedural:cabinet\n"
        "      fixed: true\n"
        "      joints:\n"
        "        drawer_1: {friction: {range: [2.0, 10.0]}, opened: {range: [0.0, 0.3]}}\n"
    )
    loaded = load(path)
    with pytest.raises(CapabilityError) as caught:
        check_engine(loaded, compile_world(loaded), Rigid, "cabinet.yaml")
    assert "world.objects.cabinet.joints.drawer_1.friction" in str(caught.value)
    assert "cannot change 'joint.friction'" in str(caught.value)
    assert "opened" not in str(caught.value)  # a state, not a parameter
