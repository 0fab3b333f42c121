"""A refusal of an engine names the line of the key that asks for what it lacks."""

from pathlib import Path

import pytest

from anysim.api import check_engine, compile_world, load
from anysim.engine.capability import Capabilities, Capability as C
from anysim.errors import CapabilityError
from anysim.testing.kinematic import NullEngine

WORLD = """\
physics:
  velocity_limits: enforce
world:
  robots:
    panda: {robot: franka_panda}
  objects:
    cube:
      source: {box: [0.05, 0.05, 0.05]}
      mass: 0.1
      restitution: 0.5
      damping: {linear: 0.1}
      contact:
        offset: 0.001
        torsional_friction: 0.01
      solver: {position_iterations: 8}
  cameras:
    front:
      from: [1, 1, 1]
      look_at: cube
      channels:
        [depth, rgb]
  lights:
    spot: {position: [0, 0, 2]}
  scenery:
    shadows: true
  contact_sensors:
    touch: {body: cube}
"""

PLACES = {
    C.RIGID_BODIES: 7,
    C.RESTITUTION: 10,
    C.BODY_DAMPING: 11,
    C.TORSIONAL_FRICTION: 5,  # the fingers of the robot come first
    C.SOLVER_SETTINGS: 15,
    C.RENDER_DEPTH: 20,
    C.RENDER_RGB: 20,
    C.RENDER_LIGHTS: 22,
    C.RENDER_SHADOWS: 25,
    C.CONTACT_SENSORS: 27,
    C.ARTICULATIONS: 5,
    C.JOINT_LIMITS: 5,
    C.CONTROL_POSITION: 5,
    C.VELOCITY_LIMITS: 2,
}
"""By capability the line of the key, or of the mapping under it where a key begins one."""


@pytest.mark.parametrize("lacking", PLACES, ids=str)
def test_the_line_of_the_key_is_named(lacking: C, tmp_path: Path) -> None:
    class Lacking(NullEngine):
        name = "lacking"
        capabilities = Capabilities.of(*(c for c in C if c is not lacking))

    file = tmp_path / "world.yaml"
    file.write_text(WORLD)
    loaded = load(file)
    with pytest.raises(CapabilityError) as caught:
        check_engine(loaded, compile_world(loaded), Lacking, "world.yaml")
    lines = {PLACES[lacking], PLACES[lacking] + 1}
    assert any(f"({lacking}) at {file}:{line}:" in str(caught.value) for line in lines), caught.value


def test_a_mapping_has_no_lines() -> None:
    loaded = load({"world": {"contact_sensors": {}, "objects": {"cube": {"source": {"box": [1, 1, 1]}}}}})

    class Lacking(NullEngine):
        name = "lacking"
        capabilities = Capabilities.of(C.CONTACTS_STATIC)

    with pytest.raises(CapabilityError, match=r"is free \(rigid bodies\) at world\.objects\.cube;"):
        check_engine(loaded, compile_world(loaded), Lacking, "a mapping")
