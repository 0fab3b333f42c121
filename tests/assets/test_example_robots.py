"""Other robots of example-robot-data: they import with the right counts, masses and kinematics."""

import logging
from math import isinf

import numpy as np
import pytest
import yourdfpy

from anysim.assets.model import ImportedModel
from anysim.assets.uri import example_robot_data
from anysim.compile.builder import WorldBuilder
from anysim.errors import AssetError
from anysim.kinematics import inertia
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.frames import find_frame
from anysim.model.world import BodyKind, EntityKind, MeshShape, World
from anysim_urdf.load import import_urdf
from tests.tiers import often

pytestmark = pytest.mark.xdist_group("example robots")  # one worker imports them, once, for all tests

ROBOTS = {  # path: moving joints, followers, mass [kg]
    "ur_description/urdf/ur5_robot.urdf": (6, 0, 20.994),
    "xarm_description/urdf/xarm7.urdf": (7, 0, 11.317),
    "solo_description/robots/solo12.urdf": (12, 0, 2.500),
    "allegro_hand_description/urdf/allegro_right_hand.urdf": (16, 0, 0.955),
    "g1_description/urdf/g1_29dof_rev_1_0.urdf": (29, 0, 33.341),
    "talos_data/robots/talos_reduced.urdf": (32, 0, 90.272),
    "kinova_description/robots/kinova.urdf": (6, 0, 4.838),
    "baxter_description/urdf/baxter.urdf": (19, 2, 137.333),
    "centauro_description/urdf/centauro.urdf": (39, 0, 117.118),
    "pr2_description/urdf/pr2.urdf": (30, 10, 257.164),
}


LARGE = ("talos_data/robots/talos_reduced.urdf", "baxter_description/urdf/baxter.urdf")
"""Those whose meshes take longest."""


@pytest.fixture(scope="module", params=often(ROBOTS.keys() - set(LARGE), ROBOTS))
def robot(request: pytest.FixtureRequest) -> tuple[str, ImportedModel]:
    root = example_robot_data()
    return request.param, import_urdf(root / request.param, root=root)


def test_counts_and_mass(robot: tuple[str, ImportedModel]) -> None:
    path, model = robot
    joints, followers, mass = ROBOTS[path]
    assert len(model.joints) == joints
    assert sum(j.mimic is not None for j in model.joints) == followers
    assert len(model.bodies) == joints + 1
    assert sum(b.inertial.mass for b in model.bodies) == pytest.approx(mass, abs=1e-3)


def test_the_model_is_consistent(robot: tuple[str, ImportedModel]) -> None:
    _, model = robot
    assert [j.body for j in model.joints] == list(range(1, len(model.bodies)))
    assert all(b.parent < i for i, b in enumerate(model.bodies))
    assert all(0 <= g.body < len(model.bodies) for g in model.geoms)
    assert len(model.geom_links) == len(model.geoms)
    assert all(model.links[link] == g.body for link, g in zip(model.geom_links, model.geoms, strict=True))
    assert len({g.name for g in model.geoms}) == len(model.geoms)
    meshes = {m.name for m in model.meshes}
    assert {g.shape.mesh for g in model.geoms if isinstance(g.shape, MeshShape)} == meshes
    assert any(g.collides for g in model.geoms)
    for body in model.bodies[1:]:
        a, b, c = np.linalg.eigvalsh(inertia.tensor(body.inertial))
        assert body.inertial.mass > 0
        assert a > 0
        assert a + b > c
    for joint in model.joints:
        assert joint.lower < joint.upper or isinf(joint.lower)
        assert np.linalg.norm(joint.axis) == pytest.approx(1, abs=1e-11)
        assert joint.mimic is not None or joint.lower <= joint.initial <= joint.upper


def test_kinematics_equal_the_source(robot: tuple[str, ImportedModel]) -> None:
    path, model = robot
    logging.getLogger("yourdfpy").setLevel(logging.ERROR)
    source = yourdfpy.URDF.load(str(example_robot_data() / path), load_meshes=False)
    builder = WorldBuilder(World())
    builder.add("r", EntityKind.ROBOT, model, root=BodyKind.STATIC)
    world = builder.build()
    rng = np.random.default_rng(1)
    for _ in range(3):
        q = np.array([rng.uniform(max(j.lower, -1), min(j.upper, 1)) for j in world.joints])
        for i, joint in enumerate(world.joints):
            if joint.mimic is not None:
                q[i] = joint.mimic.multiplier * q[joint.mimic.joint] + joint.mimic.offset
        roots = np.array([[[*b.position, *b.quaternion] for b in world.bodies]])
        poses = forward_kinematics(world, roots, q[None])[0]
        source.update_cfg({j.name[2:]: q[i] for i, j in enumerate(world.joints) if j.mimic is None})
        for link in source.link_map:
            frame = find_frame(world, f"r.{link}")
            found = P.compose(poses[frame.body], P.pose(frame.position, frame.quaternion))
            expected = source.get_transform(link, model.bodies[0].name)
            np.testing.assert_allclose(found[:3], expected[:3, 3], atol=1e-9, rtol=0, err_msg=link)
            np.testing.assert_allclose(P.to_matrix(found[3:]), expected[:3, :3], atol=1e-9, rtol=0, err_msg=link)


def test_an_unexpanded_source_is_refused() -> None:
    root = example_robot_data()
    with pytest.raises(AssetError, match="has no links"):
        import_urdf(root / "ur_description/urdf/ur3.urdf", root=root)


def test_centauro_wheels_are_continuous_and_allegro_inertias_repaired() -> None:
    root = example_robot_data()
    centauro = import_urdf(root / "centauro_description/urdf/centauro.urdf", root=root)
    wheels = [j for j in centauro.joints if "wheel" in j.name]
    assert len(wheels) == 4
    assert all(isinf(j.upper) for j in wheels)
    allegro = import_urdf(root / "allegro_hand_description/urdf/allegro_right_hand.urdf", root=root)
    assert sum(note.kind == "repaired" for note in allegro.report) == 4
