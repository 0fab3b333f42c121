"""The same joint positions on three engines: ten robots of seven kinds, as their files say them."""

from functools import partial

import pytest

from anysim.compile.world import compile_world
from anysim.engine.factory import create_simulation
from anysim_parity.kinematics import ANGLE, MASS, POSITION, kinematics_layer
from anysim_parity.result import Layer
from anysim_parity.verdict import findings
from anysim_schemas.run import WorldSpec

ENGINES = ("mujoco", "pybullet", "sapien")
DATA = "example-robot-data:"
ROBOTS = {
    "ur5": ("arm", DATA + "ur_description/urdf/ur5_robot.urdf"),
    "panda": ("arm", DATA + "panda_description/urdf/panda.urdf"),
    "baxter": ("dual arm", DATA + "baxter_description/urdf/baxter.urdf"),
    "allegro": ("dexterous hand", DATA + "allegro_hand_description/urdf/allegro_right_hand.urdf"),
    "racecar": ("mobile base", "package:pybullet_data/racecar/racecar.urdf"),
    "tiago": ("mobile manipulator", DATA + "tiago_description/robots/tiago.urdf"),
    "anymal_kinova": ("mobile manipulator", DATA + "anymal_b_simple_description/robots/anymal-kinova.urdf"),
    "g1": ("humanoid", DATA + "g1_description/urdf/g1_29dof_rev_1_0.urdf"),
    "talos": ("humanoid", DATA + "talos_data/robots/talos_reduced.urdf"),
    "solo12": ("quadruped", DATA + "solo_description/robots/solo12.urdf"),
}


@pytest.fixture(scope="module", params=ROBOTS)
def layer(request: pytest.FixtureRequest) -> Layer:
    source = {"asset": ROBOTS[request.param][1]}
    spec = WorldSpec.model_validate({"objects": {request.param: {"source": source, "fixed": True}}})
    engines = {name: partial(create_simulation, name) for name in ENGINES}
    return kinematics_layer(compile_world(spec), engines, seed=1)


def test_there_are_ten_robots_of_seven_kinds() -> None:
    assert len(ROBOTS) == 10
    assert len({kind for kind, _ in ROBOTS.values()}) == 7


@pytest.mark.slow
def test_links_are_at_the_same_places_and_equally_heavy(layer: Layer) -> None:
    """Every engine against the neutral model in double precision, within the tolerances of the comparison."""
    assert layer.refused == {}
    values = {measure.subject: measure.values for measure in layer.measures}
    position = values["link position: largest error"]
    angle = values["link orientation: largest error"]
    mass = values["mass matrix: largest error of the kinetic energy"]
    assert set(position) == set(angle) == set(mass) == set(ENGINES)
    assert POSITION <= 1e-6
    assert ANGLE <= 2e-6
    assert MASS <= 1e-4
    assert max(position.values()) <= POSITION, position
    assert max(angle.values()) <= ANGLE, angle
    assert max(mass.values()) <= MASS, mass
    for finding in findings(layer):
        assert finding.agree, finding
