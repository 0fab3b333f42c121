"""Requirements of a run: what it changes per env is known, and refused, before an engine builds anything."""

from contextlib import nullcontext
from dataclasses import replace
from typing import ClassVar

import pytest
import yaml

from anysim.api import check_engine, compile_world, load, make
from anysim.engine.options import EngineOptions
from anysim.errors import CapabilityError
from anysim.testing.kinematic import NullEngine
from anysim_sharded.engine import sharded

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
    path.write_text(YAML + "task: {observations: {policy: [last_action]}}\n")
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


class SpatialOptions(EngineOptions):
    """How many dimensions there are."""

    shaping: ClassVar[tuple[str, ...]] = ("dimensions",)
    dimensions: int = 3


class Spatial(NullEngine):
    """Refuses worlds by its options."""

    name = "spatial"
    options_type = SpatialOptions

    @classmethod
    def refusals(cls, world, options):
        return [f"'{body.name}' has depth" for body in world.bodies[:1] if options.dimensions < 3]


@pytest.mark.parametrize("kind", [Spatial, sharded(Spatial, 2)], ids=["here", "in processes"])
def test_a_refusal_sees_the_options(kind) -> None:
    """Those of the file for the engine of the file, those of the engine at a build, and defaults for others."""
    for dimensions, engine, refused in ((2, "spatial", True), (3, "spatial", False), (2, "null", False)):
        loaded = load(yaml.safe_load(YAML.replace("engine: mujoco", "engine: {name: 'null'}")))
        options = {"dimensions": dimensions} if engine == "spatial" else {}
        spec = loaded.spec.model_copy(
            update={"engine": loaded.spec.engine.model_copy(update={"name": engine, "options": options})}
        )
        world, chosen = compile_world(loaded), replace(loaded, spec=spec)
        with pytest.raises(CapabilityError, match="'cube' has depth") if refused else nullcontext():
            check_engine(chosen, world, kind, "cube.yaml")
        built = kind(**options)
        with pytest.raises(CapabilityError, match="'cube' has depth") if refused else nullcontext():
            built.create_world(world)
        built.destroy()
