"""USD files as models: units, trees, joints, masses, shapes, looks and pairs, whose answers are known."""

from math import inf, pi, radians

import numpy as np
import pytest

from anysim.assets.collision_shapes import with_collision
from anysim.assets.model import ImportedModel
from anysim.errors import AssetError
from anysim.kinematics import inertia
from anysim.kinematics.inertia import volume
from anysim.math import pose as P
from anysim.model.world import BodyKind, Box, Capsule, ControlMode, Cylinder, JointType, MeshShape, Sphere
from anysim_schemas.collision_shapes import CollisionShapesSpec
from tests.plugins.usd.conftest import HEAD, Usd, body, joint, world

CUBE = 'def Cube "c" (prepend apiSchemas = ["PhysicsCollisionAPI"]) { double size = 2\n%s }'


def words(model: ImportedModel) -> list[str]:
    return [str(note) for note in model.report]


def test_a_plain_stage_has_no_notes(usd: Usd) -> None:
    model = usd(world(body("a", CUBE % ""), body("b", CUBE % ""), joint("j", "Revolute", "a", "b")))
    assert words(model) == []
    assert [one.name for one in model.bodies] == ["a", "b"]
    assert model.bodies[0].kind is BodyKind.FREE
    assert (model.joints[0].lower, model.joints[0].upper) == (-inf, inf)


@pytest.mark.parametrize(("head", "size"), [(HEAD, 1.0), (HEAD.replace("metersPerUnit = 1", ""), 0.01)])
def test_lengths_are_in_the_stage_s_unit(usd: Usd, head: str, size: float) -> None:
    model = usd(world(body("a", CUBE % "")), head=head)
    assert model.geoms[0].shape == Box((size, size, size))
    assert model.bodies[0].inertial.mass == 1.0
    assert model.bodies[0].inertial.inertia[0] == pytest.approx(0.1 * size**2, rel=1e-12)
    assert any("no metersPerUnit" in one for one in words(model)) == (size != 1.0)


def test_masses_are_in_the_stage_s_unit_and_scaled_with_its_size(usd: Usd) -> None:
    head = HEAD.replace("kilogramsPerUnit = 1", "kilogramsPerUnit = 0.001")
    assert usd(world(body("a")), head=head).bodies[0].inertial.mass == pytest.approx(1e-3, rel=1e-12)
    scaled = usd(world(body("a", CUBE % "")), scale=2.0)
    assert scaled.geoms[0].shape == Box((2.0, 2.0, 2.0))
    assert scaled.bodies[0].inertial.mass == 8.0
    assert scaled.bodies[0].inertial.inertia[0] == pytest.approx(3.2, rel=1e-12)


def test_what_has_y_up_stands_upright(usd: Usd) -> None:
    head = HEAD.replace('"Z"', '"Y"')
    tall = (
        'def Capsule "c" (prepend apiSchemas = ["PhysicsCollisionAPI"]) { uniform token axis = "Y"\ndouble height = 3}'
    )
    model = usd(world(body("a", tall)), head=head)
    up = P.rotate(np.array(model.geoms[0].quaternion), np.array([0.0, 0.0, 1.0]))
    assert abs(abs(up[2]) - 1.0) < 1e-12
    turned = usd(
        world(
            body("a"), body("b", at="(0, 1, 0)"), joint("j", "Fixed", "a", "b", "point3f physics:localPos0 = (0, 1, 0)")
        ),
        head=head,
    )
    assert np.allclose(turned.sites[0].position, (0, 0, 1), atol=1e-12)


# ------------------------------------------------------------------ trees


def test_a_fixed_joint_to_the_world_makes_a_root_stand(usd: Usd) -> None:
    tie = joint("root", "Fixed", "", "a")
    model = usd(world(body("a"), body("b"), joint("j", "Revolute", "a", "b"), tie))
    assert model.bodies[0].kind is BodyKind.STATIC
    assert [one.name for one in model.joints] == ["j"]


def test_a_slide_to_the_world_gets_a_base(usd: Usd) -> None:
    limits = 'float physics:lowerLimit = -1\nfloat physics:upperLimit = 2\nuniform token physics:axis = "Y"'
    model = usd(world(body("cart", at="(0, 0.5, 0)"), joint("rail", "Prismatic", "", "cart", limits)))
    assert [one.name for one in model.bodies] == ["base", "cart"]
    rail = model.joints[0]
    assert (rail.type, rail.axis, rail.lower, rail.upper) == (JointType.PRISMATIC, (0.0, 1.0, 0.0), -1.0, 2.0)
    assert rail.initial == 0.5
    assert any("gets a fixed base" in one for one in words(model))


def test_a_joint_counts_the_same_whichever_body_comes_first(usd: Usd) -> None:
    """With the child as the first body a joint turns the other way about its axis, and its position is the same."""
    frames = "point3f physics:localPos0 = (0, 0, 1)\npoint3f physics:localPos1 = (0.5, 0, 0)"
    other = "point3f physics:localPos0 = (0.5, 0, 0)\npoint3f physics:localPos1 = (0, 0, 1)"
    tie = joint("root", "Fixed", "", "a")
    one = usd(world(body("a"), body("b"), tie, joint("j", "Revolute", "a", "b", frames)))
    back = usd(world(body("a"), body("b"), tie, joint("j", "Revolute", "b", "a", other)))
    assert one.bodies[1].position == back.bodies[1].position == (-0.5, 0.0, 1.0)
    assert one.joints[0].anchor == back.joints[0].anchor == (0.5, 0.0, 0.0)
    assert (one.joints[0].axis, back.joints[0].axis) == ((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0))


def test_what_fixed_joints_join_is_one_body(usd: Usd) -> None:
    tie = joint("weld", "Fixed", "a", "b", "point3f physics:localPos0 = (1, 0, 0)")
    model = usd(world(body("a"), body("b", at="(1, 0, 0)"), tie))
    assert len(model.bodies) == 1
    assert model.bodies[0].inertial.mass == 2.0
    assert model.bodies[0].inertial.com == (0.5, 0.0, 0.0)
    assert model.bodies[0].inertial.inertia[1] == pytest.approx(0.2 + 2 * 0.25, rel=1e-12)
    assert (model.sites[0].name, model.sites[0].position) == ("b", (1.0, 0.0, 0.0))


def test_a_loop_is_refused_and_one_that_is_excluded_is_noted(usd: Usd) -> None:
    ring = [body("a"), body("b"), body("c"), joint("j", "Revolute", "a", "b"), joint("k", "Revolute", "b", "c")]
    with pytest.raises(AssetError, match="joint 'k' closes a loop"):
        usd(world(*ring, joint("l", "Revolute", "c", "a")))
    open_ = usd(world(*ring, joint("l", "Revolute", "c", "a", "uniform bool physics:excludeFromArticulation = true")))
    assert len(open_.joints) == 2
    assert any("the joint closes a loop, and is left out (1: l)" in one for one in words(open_))


def test_of_several_trees_one_is_named(usd: Usd) -> None:
    text = world(body("cup"), body("pot"), 'def Xform "arm" {', body("cup"), "}")
    with pytest.raises(AssetError, match="holds 3 trees of bodies, World/cup, pot, World/arm/cup; name the one"):
        usd(text)
    assert usd(text, body="pot").bodies[0].name == "pot"
    assert usd(text, body="World/arm/cup").bodies[0].name == "cup"
    with pytest.raises(AssetError, match="there are several 'cup'"):
        usd(text, body="cup")
    with pytest.raises(AssetError, match="there is no 'pott'; did you mean 'pot'"):
        usd(text, body="pott")


def test_without_a_body_the_shapes_are_one_thing_that_stands(usd: Usd) -> None:
    model = usd(world(CUBE % ""))
    assert (model.bodies[0].name, model.bodies[0].kind, len(model.geoms)) == ("World", BodyKind.STATIC, 1)
    with pytest.raises(AssetError, match="holds no rigid body and no shape"):
        usd(world())


# ------------------------------------------------------------------ joints


def test_angles_are_radians_and_gains_are_of_them(usd: Usd) -> None:
    drive = """float physics:lowerLimit = -90
    float physics:upperLimit = 45
    float drive:angular:physics:stiffness = 2
    float drive:angular:physics:damping = 0.1
    float drive:angular:physics:maxForce = 7
    float physxJoint:armature = 0.01
    float physxJoint:maxJointVelocity = 180"""
    text = joint("j", "Revolute", "a", "b", drive, '"PhysicsDriveAPI:angular", "PhysxJointAPI"')
    model = usd(world(body("a"), body("b"), text))
    found, hint = model.joints[0], model.actuator_hints[0]
    assert (found.lower, found.upper) == pytest.approx((-pi / 2, pi / 4), rel=1e-15)
    assert (found.velocity_limit, found.effort_limit, found.armature) == (pytest.approx(pi), 7.0, 0.01)
    assert (hint.mode, hint.kp, hint.kd) == (
        ControlMode.POSITION,
        pytest.approx(2 / radians(1), rel=1e-12),
        pytest.approx(0.1 / radians(1), rel=1e-12),
    )


def test_a_slide_in_centimetres_has_forces_in_newton(usd: Usd) -> None:
    """A force of a stage is in kilogram centimetres per second squared."""
    drive = "float physics:upperLimit = 20\nfloat drive:linear:physics:maxForce = 500"
    drive += "\nfloat drive:linear:physics:stiffness = 3"
    text = joint("j", "Prismatic", "a", "b", drive, '"PhysicsDriveAPI:linear"')
    model = usd(world(body("a"), body("b"), text), head=HEAD.replace("metersPerUnit = 1", "metersPerUnit = 0.01"))
    assert model.joints[0].upper == pytest.approx(0.2, rel=1e-12)
    assert model.joints[0].effort_limit == pytest.approx(5.0, rel=1e-12)
    assert model.actuator_hints[0].kp == 3.0  # N/m is kg/s^2: no length in it


def test_where_bodies_stand_is_where_a_joint_is_at_first(usd: Usd) -> None:
    turn = body("b", "quatd xformOp:orient = (0.9659258262890683, 0, 0, 0.25881904510252074)")
    turn = turn.replace('["xformOp:translate"]', '["xformOp:translate", "xformOp:orient"]')
    model = usd(world(body("a"), turn, joint("j", "Revolute", "a", "b", 'uniform token physics:axis = "Z"')))
    assert model.joints[0].initial == pytest.approx(pi / 6, abs=1e-12)
    apart = usd(world(body("a"), body("b", at="(0, 0, 0.01)"), joint("j", "Revolute", "a", "b")))
    assert any("its bodies stand 10 mm and 0 rad beside it in the file" in one for one in words(apart))


def test_a_ball_joint_becomes_three_hinges(usd: Usd) -> None:
    cone = "float physics:coneAngle0Limit = 30\npoint3f physics:localPos0 = (0, 0, 1)"
    cone += "\npoint3f physics:localPos1 = (0, 0, -1)"
    model = usd(world(body("a"), body("b", at="(0, 0, 2)"), joint("ball", "Spherical", "a", "b", cone)))
    assert [one.name for one in model.joints] == ["ball.roll", "ball.pitch", "ball.yaw"]
    assert model.bodies[1].position == (0.0, 0.0, 1.0)
    assert model.joints[2].anchor == (0.0, 0.0, -1.0)
    assert any("becomes a chain of hinges .roll, .pitch and .yaw; its cone is left out" in one for one in words(model))


def test_a_joint_without_a_type_moves_in_what_is_not_locked(usd: Usd) -> None:
    names = ("transX", "transY", "transZ", "rotX", "rotY", "rotZ")
    locked = [f"float limit:{n}:physics:low = 1\nfloat limit:{n}:physics:high = -1" for n in names if n != "transY"]
    free = "float limit:transY:physics:low = -0.5\nfloat limit:transY:physics:high = 0.25"
    one = usd(world(body("a"), body("b"), joint("j", "", "a", "b", "\n".join([*locked, free]))))
    assert (one.joints[0].name, one.joints[0].type) == ("j", JointType.PRISMATIC)
    assert (one.joints[0].lower, one.joints[0].upper, one.joints[0].axis) == (-0.5, 0.25, (0.0, 1.0, 0.0))
    two = usd(world(body("a"), body("b"), joint("j", "", "a", "b", "\n".join(locked[:-1]))))
    assert [part.name for part in two.joints] == ["j.y", "j.yaw"]
    with pytest.raises(AssetError, match="2 trees"):
        usd(world(body("a"), body("b"), joint("j", "", "a", "b")))


def test_joints_between_the_same_bodies_move_one_after_another(usd: Usd) -> None:
    """As MuJoCo writes a body with two hinges: about z first, and about the x that has turned with it."""
    ends = "point3f physics:localPos0 = (0, 0, 1)\npoint3f physics:localPos1 = (0, 0.5, 0)\n"
    hinges = [
        joint(name, "Revolute", "a", "b", f'{ends}uniform token physics:axis = "{axis}"')
        for name, axis in (("z", "Z"), ("x", "X"))
    ]
    model = usd(world(body("a"), body("b", at="(0, -0.5, 1)"), *hinges))
    assert [one.name for one in model.joints] == ["z", "x"]
    assert [one.axis for one in model.joints] == [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0)]
    assert [one.anchor for one in model.joints] == [(0.0, 0.5, 0.0)] * 2
    assert [one.position for one in model.bodies] == [(0.0, 0.0, 0.0), (0.0, -0.5, 1.0), (0.0, 0.0, 0.0)]
    assert [one.name for one in model.bodies] == ["a", "b.z", "b"]


@pytest.mark.parametrize(
    ("schemas", "text"),
    [
        (
            '"PhysxMimicJointAPI:rotX"',
            "rel physxMimicJoint:rotX:referenceJoint = </World/j>\nfloat physxMimicJoint:rotX:gearing = -2\n"
            "float physxMimicJoint:rotX:offset = -30",
        ),
        (
            '"NewtonMimicAPI"',
            "rel newton:mimicJoint = </World/j>\nfloat newton:mimicCoef1 = 2\nfloat newton:mimicCoef0 = 30",
        ),
        (
            '"MjcEqualityJointAPI"',
            "rel mjc:target = </World/j>\ndouble mjc:coef1 = 2\ndouble mjc:coef0 = 0.5235987755982988",
        ),
    ],
)
def test_joints_follow_others_as_each_program_writes_it(usd: Usd, schemas: str, text: str) -> None:
    parts = [body("a"), body("b"), body("c"), joint("j", "Revolute", "a", "b")]
    model = usd(world(*parts, joint("k", "Revolute", "a", "c", text, schemas)))
    mimic = model.joints[1].mimic
    assert mimic is not None
    assert (mimic.joint, mimic.multiplier, mimic.offset) == (0, 2.0, pytest.approx(pi / 6, rel=1e-12))


def test_a_distance_joint_is_left_out_by_name(usd: Usd) -> None:
    model = usd(world(body("a"), body("b"), joint("d", "Distance", "a", "b"), joint("j", "Revolute", "a", "b")))
    assert any(one.startswith("prim PhysicsDistanceJoint: is left out: joints hold directions") for one in words(model))


# ------------------------------------------------------------------ masses


def test_a_mass_that_is_not_given_is_of_density_and_shapes(usd: Usd) -> None:
    bare = 'def Xform "a" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]) {\n%s\n}\n'
    water = usd(world(bare % (CUBE % "")))
    assert water.bodies[0].inertial.mass == pytest.approx(8000.0)
    assert any("says no mass; that of its shapes is 8000 kg" in one for one in words(water))
    wood = usd(world(bare % ("float physics:density = 500\n" + CUBE % "")))
    assert wood.bodies[0].inertial.mass == pytest.approx(4000.0)
    light = 'def Material "m" (prepend apiSchemas = ["PhysicsMaterialAPI"]) {\nfloat physics:density = 10\n}'
    bound = (CUBE % "rel material:binding:physics = </World/m>").replace('API"]', 'API", "MaterialBindingAPI"]')
    assert usd(world(bare % bound, light)).bodies[0].inertial.mass == pytest.approx(80.0)
    both = usd(world(bare % ("float physics:density = 500\n" + bound), light))
    assert both.bodies[0].inertial.mass == pytest.approx(4000.0)  # a material's is the weakest
    own = (CUBE % "float physics:mass = 3").replace('PhysicsCollisionAPI"', 'PhysicsCollisionAPI", "PhysicsMassAPI"')
    assert usd(world(bare % own)).bodies[0].inertial.inertia[0] == pytest.approx(3 * 4 / 6)
    halves = 'def Cylinder "s" (prepend apiSchemas = ["PhysicsCollisionAPI"]) { double radius = 1\ndouble height = 1\n}'
    given = usd(world(bare % ("float physics:mass = 2\n" + halves)))
    assert given.bodies[0].inertial.inertia[2] == pytest.approx(0.5 * 2)


def test_principal_axes_turn_the_moments(usd: Usd) -> None:
    text = body("a").replace("(0.1, 0.1, 0.1)", "(0.1, 0.2, 0.25)")
    turn = text.replace("point3f", "quatf physics:principalAxes = (0.7071068, 0, 0, 0.7071068)\npoint3f")
    found = inertia.tensor(usd(world(turn)).bodies[0].inertial)
    assert np.allclose(found, np.diag([0.2, 0.1, 0.25]), atol=1e-7)


def test_an_impossible_inertia_is_repaired(usd: Usd) -> None:
    model = usd(world(body("a").replace("(0.1, 0.1, 0.1)", "(0.1, 0.1, 0.5)")))
    assert any("has an inertia that no body can have" in one for one in words(model))


# ------------------------------------------------------------------ shapes


@pytest.mark.parametrize(
    ("kind", "shape"),
    [('Sphere "s"', Sphere(0.5)), ('Cylinder "s"', Cylinder(0.5, 1.5)), ('Capsule "s"', Capsule(0.5, 1.5))],
)
def test_solids_are_as_they_are(usd: Usd, kind: str, shape: object) -> None:
    size = "double radius = 0.5" + ("" if "Sphere" in kind else '\ndouble height = 3\nuniform token axis = "X"')
    text = f'def {kind} (prepend apiSchemas = ["PhysicsCollisionAPI"]) {{ {size} }}'
    geom = usd(world(body("a", text))).geoms[0]
    assert geom.shape == shape
    if "Sphere" not in kind:
        assert np.allclose(np.abs(P.rotate(np.array(geom.quaternion), np.array([0, 0, 1.0]))), (1, 0, 0), atol=1e-12)


def test_what_is_stretched_is_a_mesh_of_its_triangles(usd: Usd) -> None:
    stretched = 'double radius = 1\ndouble3 xformOp:scale = (1, 2, 1)\nuniform token[] xformOpOrder = ["xformOp:scale"]'
    text = f'def Sphere "s" (prepend apiSchemas = ["PhysicsCollisionAPI"]) {{\n{stretched}\n}}'
    model = usd(world(body("a", text)))
    hull = next(geom for geom in model.geoms if geom.collides)
    assert isinstance(hull.shape, MeshShape)
    points = next(mesh for mesh in model.meshes if mesh.name == hull.shape.mesh).vertices
    assert np.ptp(points[:, 1]) == pytest.approx(4.0, rel=0.01)


L_SHAPE = """def Mesh "m" (prepend apiSchemas = ["PhysicsCollisionAPI", "PhysicsMeshCollisionAPI"]) {
    point3f[] points = [(0,0,0), (2,0,0), (2,1,0), (1,1,0), (1,2,0), (0,2,0),
                        (0,0,1), (2,0,1), (2,1,1), (1,1,1), (1,2,1), (0,2,1)]
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [0,1,7,6, 1,2,8,7, 2,3,9,8, 3,4,10,9, 4,5,11,10, 5,0,6,11,
                               0,3,2,1, 0,5,4,3, 6,7,8,9, 6,9,10,11]
    uniform token physics:approximation = "%s"
    uniform token subdivisionScheme = "none"
    %s
}"""


def test_meshes_collide_as_their_file_says_or_a_note_tells(usd: Usd) -> None:
    hull = usd(world(body("a", L_SHAPE % ("convexHull", ""))))
    assert not any("collides" in one for one in words(hull))
    assert [geom.collides for geom in hull.geoms] == [True, False]
    for kind in ("convexDecomposition", "sdf"):
        assert any(
            f"collides as {kind} in its file, here as its" in one
            for one in words(usd(world(body("a", L_SHAPE % (kind, "")))))
        )
    assert any("collides by each triangle" in one for one in words(usd(world(body("a", L_SHAPE % ("none", ""))))))
    cube = usd(world(body("a", L_SHAPE % ("boundingCube", "")))).geoms[0]
    assert (cube.shape, cube.position) == (Box((1.0, 1.0, 0.5)), (1.0, 1.0, 0.5))
    ball = usd(world(body("a", L_SHAPE % ("boundingSphere", "")))).geoms[0]
    assert ball.shape == Sphere(pytest.approx(1.5))


def test_a_mesh_can_collide_in_convex_pieces(usd: Usd) -> None:
    pytest.importorskip("coacd", reason="meshes are decomposed by CoACD, which the dependency group `test` has")
    model = usd(world(body("a", L_SHAPE % ("convexDecomposition", ""))))
    assert [whole.volume for whole in model.wholes.values()] == [pytest.approx(3.0)]
    found = with_collision(model, CollisionShapesSpec(method="decompose"))
    meshes = {mesh.name: mesh for mesh in found.meshes}
    pieces = [volume(geom.shape, meshes) for geom in found.geoms if geom.collides]
    assert len(pieces) > 1
    assert sum(pieces) == pytest.approx(3.0, rel=0.02)


def test_a_mesh_that_is_damaged_is_refused(usd: Usd) -> None:
    for old, new, match in (
        ("0,1,7,6", "0,1,7,99", "has 12 points, and a face that asks for another"),
        ("[4, 4,", "[5, 4,", "has 40 corners, and its faces have 41"),
        ("(0,0,0)", "(nan,0,0)", "has a point that is no number"),
    ):
        with pytest.raises(AssetError, match=match):
            usd(world(body("a", (L_SHAPE % ("none", "")).replace(old, new))))


def test_what_is_hidden_or_for_guidance_is_not_seen(usd: Usd) -> None:
    guide = usd(world(body("a", CUBE % 'uniform token purpose = "guide"'))).geoms[0]
    hidden = usd(world(body("a", CUBE % 'token visibility = "invisible"'))).geoms[0]
    assert (guide.collides, guide.visible) == (hidden.collides, hidden.visible) == (True, False)
    off = usd(world(body("a", CUBE % "bool physics:collisionEnabled = false"))).geoms[0]
    assert (off.collides, off.visible) == (False, True)


MATERIALS = """def Material "red" { token outputs:surface.connect = </World/red/s.outputs:surface>
    def Shader "s" { uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (1, 0, 0)
        float inputs:opacity = 0.5
        float inputs:roughness = 0.3
        token outputs:surface
    } }
    def Material "rubber" (prepend apiSchemas = ["PhysicsMaterialAPI"]) {
        float physics:staticFriction = 1.2
        float physics:dynamicFriction = 0.9
        float physics:restitution = 0.25
    }"""


def test_materials_give_colours_and_surfaces(usd: Usd) -> None:
    bound = "rel material:binding = </World/red>\nrel material:binding:physics = </World/rubber>"
    cube = (CUBE % bound).replace('PhysicsCollisionAPI"', 'PhysicsCollisionAPI", "MaterialBindingAPI"')
    model = usd(world(body("a", cube), MATERIALS))
    geom = model.geoms[0]
    assert geom.color == (1.0, 0.0, 0.0, 0.5)
    assert (geom.surface.friction, geom.surface.restitution) == (0.9, 0.25)
    assert any("holds by 1.2 and slides by 0.9" in one for one in words(model))
    assert any(one.startswith("inputs:roughness: is left out") for one in words(model))


def test_subsets_of_a_mesh_have_their_colours(usd: Usd) -> None:
    subset = """def GeomSubset "top" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        uniform token familyName = "materialBind"
        int[] indices = [8, 9]
        rel material:binding = </World/red>
    }
    color3f[] primvars:displayColor = [(0, 1, 0)]"""
    model = usd(world(body("a", L_SHAPE % ("convexHull", subset)), MATERIALS))
    assert [geom.color[:3] for geom in model.geoms if geom.visible] == [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]


# ------------------------------------------------------------------ composition


TWO_SIZES = """def Xform "World" (
    variants = { string size = "big" }
    prepend variantSets = "size"
) {
    variantSet "size" = {
        "big" {
            def Cube "x" { double size = 4 }
        }
        "small" {
            def Cube "x" { double size = 1 }
        }
    }
    def Xform "a" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]) {
        float physics:mass = 1
        def Xform "l" (
            instanceable = true
            inherits = </_leg>
        ) { }
        def Xform "r" (
            instanceable = true
            inherits = </_leg>
        ) { }
    }
}
"""


def test_instances_and_variants_are_unfolded(usd: Usd) -> None:
    text = f'class Xform "_leg" {{\n{CUBE % ""}\n}}\n{TWO_SIZES}'
    assert len(usd(text).geoms) == 2
    assert usd(text, body="/").geoms[0].shape == Box((2.0, 2.0, 2.0))


def test_filters_keep_bodies_apart(usd: Usd) -> None:
    parts = [body(n, CUBE % "") for n in "abc"]
    joints = [joint("j", "Revolute", "a", "b"), joint("k", "Revolute", "b", "c")]
    filtered = body(
        "a", (CUBE % "") + "\nrel physics:filteredPairs = </World/c>", schemas=', "PhysicsFilteredPairsAPI"'
    )
    assert usd(world(filtered, *parts[1:], *joints)).excluded_pairs == {(0, 2)}
    group = """def PhysicsCollisionGroup "g" (prepend apiSchemas = ["CollectionAPI:colliders"]) {
        rel collection:colliders:includes = [</World/a>, </World/c>]
        rel physics:filteredGroups = </World/g>
    }"""
    assert usd(world(*parts, *joints, group)).excluded_pairs == {(0, 2)}
    one = body("a", (CUBE % "") + "\n" + (CUBE % "").replace('"c"', '"d"'))
    partly = usd(world(one, *parts[1:], *joints, group.replace("</World/a>", "</World/a/d>")))
    assert partly.excluded_pairs == frozenset()
    assert any("keep apart only some shapes of 1 pairs of bodies" in note for note in words(partly))
