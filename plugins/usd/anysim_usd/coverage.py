"""Table of what becomes of each prim, schema and attribute of a USD file: the importer asks it.

A row without attributes is of a type of prim, or of a schema that is applied to one; `*` stands for the name of an
instance, such as `angular`. What is not in the table is left out with a note.
"""

import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from anysim.assets.model import Fate


class Row(NamedTuple):
    """The fate of attributes of a schema, or of the schema itself where it names none; `text` says how or why."""

    path: str
    fate: Fate
    attributes: str = ""
    text: str = ""


_EXACT, _ABOUT, _NOT, _OUT, _IDLE = Fate
_WORLD_S = "those of a world are its own; `world.source` reads them"
_HULL = "what collides is its convex hull, of at most 64 corners"
_SOLVER = "solvers are the engine's"
_START = "where and how fast a thing is at first is the world's"
_PLAIN = "surfaces have plain colours"


def _joint(kind: str, fate: Fate = _EXACT, text: str = "") -> Iterator[Row]:
    yield Row(kind, fate, "", text)
    if fate is not _OUT and "Fixed" not in kind and kind != "PhysicsJoint":
        yield Row(kind, _EXACT, "physics:axis")


ROWS: tuple[Row, ...] = (
    # ------------------------------------------------------------------ the stage
    Row("stage", _EXACT, "upAxis metersPerUnit kilogramsPerUnit", "without them USD's defaults: y, 0.01 m, 1 kg"),
    Row("stage", _EXACT, "subLayers references payload variantSets inherits", "of variants those that are selected"),
    Row("stage", _NOT, "clips", "they are files of their own"),
    Row("stage", _ABOUT, "timeSamples", "of what changes in time, the first value counts"),
    Row("stage", _IDLE, "defaultPrim startTimeCode endTimeCode timeCodesPerSecond framesPerSecond customLayerData"),
    Row("prim", _EXACT, "active instanceable purpose visibility", "what is for guidance or hidden is not drawn"),
    Row("prim", _IDLE, "kind documentation customData assetInfo extent extentsHint proxyPrim"),
    Row("prim", _IDLE, "ui:* model:* userProperties:*", "what tools keep for themselves"),
    *(Row(kind, _IDLE) for kind in ("GeomModelAPI", "NodeGraphNodeAPI", "AssetPreviewsAPI")),
    *(Row(kind, _OUT, "", "what things are is the world's to say") for kind in ("SemanticsAPI", "SemanticsLabelsAPI")),
    Row("SemanticsAPI", _OUT, "semantic:* semantics:*", "what things are is the world's to say"),
    *(Row(kind, _IDLE) for kind in ("Xform", "Scope")),
    Row("Xformable", _EXACT, "xformOp:* xformOpOrder", "scale is of shapes, and of places within"),
    # ------------------------------------------------------------------ bodies and masses
    Row("PhysicsRigidBodyAPI", _EXACT, "", "a body is called as its prim, or as its path where several are"),
    Row("PhysicsRigidBodyAPI", _EXACT, "physics:rigidBodyEnabled", "without it, a part of what carries it"),
    Row("PhysicsRigidBodyAPI", _ABOUT, "physics:kinematicEnabled", "it stands still"),
    Row("PhysicsRigidBodyAPI", _OUT, "physics:velocity physics:angularVelocity physics:startsAsleep", _START),
    Row("PhysicsRigidBodyAPI", _OUT, "physics:simulationOwner", "there is one scene"),
    Row("PhysicsMassAPI", _EXACT),
    Row("PhysicsMassAPI", _EXACT, "physics:mass physics:density", "without a mass, of the shapes that collide"),
    Row("PhysicsMassAPI", _EXACT, "physics:centerOfMass physics:diagonalInertia physics:principalAxes"),
    Row("PhysicsArticulationRootAPI", _EXACT, "", "the body that carries the others"),
    # ------------------------------------------------------------------ joints
    *_joint("PhysicsFixedJoint", text="what is joined becomes one body"),
    *_joint("PhysicsRevoluteJoint"),
    *_joint("PhysicsPrismaticJoint"),
    *_joint("PhysicsSphericalJoint", _ABOUT, "a chain of three hinges; at a pitch of 90 degrees a turn is lost"),
    *_joint("PhysicsJoint", _ABOUT, "a chain of one joint for each direction that is not locked"),
    Row("PhysicsDistanceJoint", _OUT, "", "joints hold directions, not distances"),
    Row("joint", _EXACT, "physics:body0 physics:body1"),
    Row("joint", _EXACT, "physics:localPos0 physics:localRot0 physics:localPos1 physics:localRot1"),
    Row("joint", _EXACT, "physics:jointEnabled", "one that is not is left out, with a note"),
    Row("joint", _EXACT, "physics:lowerLimit physics:upperLimit", "in degrees, where it turns"),
    Row("joint", _OUT, "physics:excludeFromArticulation", "the joint closes a loop, and is left out"),
    Row("joint", _OUT, "physics:collisionEnabled", "bodies that a joint ties never collide"),
    Row("joint", _OUT, "physics:breakForce physics:breakTorque", "joints do not break"),
    Row("joint", _OUT, "physics:coneAngle0Limit physics:coneAngle1Limit", "a chain of hinges has no cone"),
    Row("joint", _OUT, "physics:minDistance physics:maxDistance", "joints hold directions, not distances"),
    Row("PhysicsLimitAPI", _EXACT),
    Row("PhysicsLimitAPI", _EXACT, "limit:*:physics:low limit:*:physics:high", "locked where the low one is higher"),
    Row("PhysicsDriveAPI", _EXACT),
    Row("PhysicsDriveAPI", _EXACT, "drive:*:physics:stiffness drive:*:physics:damping", "per degree, where it turns"),
    Row("PhysicsDriveAPI", _EXACT, "drive:*:physics:maxForce", "of the drive, and of the joint"),
    Row("PhysicsDriveAPI", _ABOUT, "drive:*:physics:type", "drives that give accelerations are left out, with a note"),
    Row("PhysicsDriveAPI", _OUT, "drive:*:physics:targetPosition drive:*:physics:targetVelocity", "`home` has it"),
    # ------------------------------------------------------------------ what touches
    Row("PhysicsCollisionAPI", _EXACT),
    Row("PhysicsCollisionAPI", _EXACT, "physics:collisionEnabled"),
    Row("PhysicsCollisionAPI", _OUT, "physics:simulationOwner", "there is one scene"),
    Row("PhysicsMeshCollisionAPI", _EXACT),
    Row(
        "PhysicsMeshCollisionAPI",
        _ABOUT,
        "physics:approximation",
        f"convexHull, boundingCube and boundingSphere are exact; of others {_HULL}",
    ),
    Row("PhysicsMaterialAPI", _EXACT),
    Row("PhysicsMaterialAPI", _EXACT, "physics:dynamicFriction physics:restitution"),
    Row("PhysicsMaterialAPI", _ABOUT, "physics:staticFriction", "friction is one number: that of what slides"),
    Row("PhysicsCollisionGroup", _ABOUT, "", "bodies of which all shapes are kept apart never collide"),
    Row(
        "PhysicsCollisionGroup",
        _ABOUT,
        "physics:filteredGroups physics:invertFilteredGroups collection:colliders:*",
        "bodies of which all shapes are kept apart never collide",
    ),
    Row("PhysicsCollisionGroup", _OUT, "physics:mergeGroup", "each prim is a group of its own"),
    Row("CollectionAPI", _IDLE),
    Row("PhysicsFilteredPairsAPI", _EXACT),
    Row("PhysicsFilteredPairsAPI", _ABOUT, "physics:filteredPairs", "bodies of which all shapes are kept apart"),
    # ------------------------------------------------------------------ shapes and looks
    Row("Cube", _EXACT, "size"),
    Row("Sphere", _EXACT, "radius", "one that is stretched is a mesh"),
    Row("Cylinder", _EXACT, "radius height axis", "one that is stretched across is a mesh"),
    Row("Capsule", _EXACT, "radius height axis", "one that is stretched is a mesh"),
    Row("Cone", _ABOUT, "radius height axis", "a mesh of 32 sides"),
    Row("Plane", _ABOUT, "axis width length", "a level one at height 0 is the ground of a world; others a box of 1 m"),
    *(Row(kind, _EXACT) for kind in ("Cube", "Sphere", "Cylinder", "Capsule")),
    Row("Cone", _ABOUT, "", "a mesh of 32 sides"),
    Row("Plane", _ABOUT, "", "a level one at height 0 is the ground of a world; others are a box 1 m thick"),
    Row("Mesh", _ABOUT, "", _HULL),
    Row("Mesh", _EXACT, "points faceVertexCounts faceVertexIndices orientation holeIndices"),
    Row("Mesh", _IDLE, "subdivisionScheme", "the mesh itself is what is seen"),
    Row(
        "Mesh", _IDLE, "normals doubleSided interpolateBoundary faceVaryingLinearInterpolation triangleSubdivisionRule"
    ),
    Row("Mesh", _IDLE, "primvars:normals primvars:normals:indices"),
    Row("Mesh", _OUT, "cornerIndices cornerSharpnesses creaseIndices creaseLengths creaseSharpnesses", _PLAIN),
    Row("Mesh", _OUT, "velocities accelerations", "bodies are rigid"),
    Row("GeomSubset", _EXACT, "", "a part of a mesh with a colour of its own"),
    Row("GeomSubset", _EXACT, "indices"),
    Row("GeomSubset", _IDLE, "elementType familyName subsetFamily:*"),
    *(
        Row(kind, _OUT, "", "shapes are solids and meshes")
        for kind in ("Points", "BasisCurves", "NurbsCurves", "NurbsPatch", "HermiteCurves", "TetMesh", "PointInstancer")
    ),
    *(Row(kind, _OUT, "", "bodies are rigid") for kind in ("SkelRoot", "Skeleton", "SkelAnimation")),
    Row("SkelBindingAPI", _OUT, "", "bodies are rigid"),
    Row("Gprim", _ABOUT, "primvars:displayColor", "of several colours the mean"),
    Row("Gprim", _ABOUT, "primvars:displayOpacity", "of several the mean"),
    Row("Gprim", _IDLE, "primvars:displayColor:indices primvars:displayOpacity:indices"),
    Row("Gprim", _OUT, "primvars:*", _PLAIN),
    Row("MaterialBindingAPI", _EXACT),
    Row("MaterialBindingAPI", _EXACT, "material:binding material:binding:*"),
    *(Row(kind, _EXACT) for kind in ("Material", "Shader", "NodeGraph")),
    Row("Shader", _EXACT, "inputs:diffuseColor inputs:opacity", "of a UsdPreviewSurface"),
    Row("Shader", _EXACT, "inputs:diffuse_color_constant inputs:opacity_constant", "of an OmniPBR"),
    Row("Shader", _IDLE, "info:* outputs:* inputs:varname inputs:opacityThreshold inputs:enable_opacity"),
    Row("Shader", _OUT, "inputs:*", _PLAIN),
    Row("NodeGraph", _IDLE, "outputs:*"),
    # ------------------------------------------------------------------ around
    Row("PhysicsScene", _EXACT, "", "of a world; of an asset, all this is left to the world that it is put into"),
    Row("PhysicsScene", _EXACT, "physics:gravityDirection physics:gravityMagnitude"),
    Row("PhysxSceneAPI", _IDLE),
    Row("PhysxSceneAPI", _EXACT, "physxScene:timeStepsPerSecond", "of a world"),
    Row("PhysxSceneAPI", _OUT, "physxScene:*", _SOLVER),
    Row("Camera", _EXACT, "", "of a world; of an asset it is left out"),
    Row("Camera", _EXACT, "focalLength verticalAperture horizontalAperture clippingRange", "of a world"),
    Row(
        "Camera", _OUT, "fStop focusDistance exposure projection shutter:* horizontalApertureOffset", "it is a pinhole"
    ),
    Row("Camera", _OUT, "verticalApertureOffset clippingPlanes stereoRole exposure:*", "it is a pinhole"),
    *(Row(kind, _ABOUT, "", "of a world: a light in one direction") for kind in ("DistantLight",)),
    *(
        Row(kind, _ABOUT, "", "of a world: a light from one point")
        for kind in ("SphereLight", "RectLight", "DiskLight", "CylinderLight")
    ),
    Row("DomeLight", _OUT, "", "`scenery` has the light that is all around"),
    Row("light", _ABOUT, "inputs:color inputs:intensity inputs:exposure", "the brightest of a world has 0.8"),
    Row("light", _IDLE, "inputs:angle inputs:radius inputs:width inputs:height inputs:length inputs:normalize"),
    Row("light", _OUT, "light:* collection:*", "lights reach everywhere"),
    *(Row(kind, _IDLE) for kind in ("ShadowAPI", "ShapingAPI", "LightAPI")),
    Row("light", _OUT, "inputs:shadow:* inputs:shaping:*", "lights are no cones"),
    # ------------------------------------------------------------------ as Isaac writes them
    *(
        Row(kind, _IDLE)
        for kind in (
            "PhysxRigidBodyAPI PhysxArticulationAPI PhysxJointAPI PhysxJointAxisAPI PhysxCollisionAPI "
            "PhysxMaterialAPI PhysxConvexHullCollisionAPI PhysicsJointStateAPI PhysxLimitAPI IsaacLinkAPI "
            "IsaacJointAPI IsaacRobotAPI PhysxMimicJointAPI PhysxContactReportAPI"
        ).split()
    ),
    Row("PhysxRigidBodyAPI", _EXACT, "physxRigidBody:disableGravity"),
    Row(
        "PhysxRigidBodyAPI",
        _EXACT,
        "physxRigidBody:linearDamping physxRigidBody:angularDamping",
        "of what floats alone",
    ),
    Row("PhysxRigidBodyAPI", _OUT, "physxRigidBody:*", _SOLVER),
    Row(
        "PhysxArticulationAPI", _OUT, "physxArticulation:enabledSelfCollisions", "`self_collision` of the entry has it"
    ),
    Row("PhysxArticulationAPI", _OUT, "physxArticulation:*", _SOLVER),
    Row("PhysxJointAPI", _EXACT, "physxJoint:armature"),
    Row("PhysxJointAPI", _EXACT, "physxJoint:maxJointVelocity", "in degrees, where it turns"),
    Row("PhysxJointAPI", _ABOUT, "physxJoint:jointFriction", "as a dry friction: PhysX takes it for a coefficient"),
    Row("PhysxJointAPI", _OUT, "physxJoint:*", _SOLVER),
    Row("PhysxJointAxisAPI", _EXACT, "physxJointAxis:*:armature"),
    Row("PhysxJointAxisAPI", _EXACT, "physxJointAxis:*:maxJointVelocity", "in degrees, where it turns"),
    Row("PhysxJointAxisAPI", _EXACT, "physxJointAxis:*:dynamicFrictionEffort", "the dry friction"),
    Row("PhysxJointAxisAPI", _ABOUT, "physxJointAxis:*:staticFrictionEffort", "friction is that of what slides"),
    Row("PhysxJointAxisAPI", _EXACT, "physxJointAxis:*:viscousFrictionCoefficient", "per degree, where it turns"),
    Row("PhysxMimicJointAPI", _EXACT, "physxMimicJoint:*:gearing physxMimicJoint:*:offset"),
    Row("PhysxMimicJointAPI", _EXACT, "physxMimicJoint:*:referenceJoint"),
    Row("PhysxMimicJointAPI", _IDLE, "physxMimicJoint:*:referenceJointAxis", "joints have one axis"),
    Row("PhysxMimicJointAPI", _OUT, "physxMimicJoint:*:naturalFrequency physxMimicJoint:*:dampingRatio", _SOLVER),
    Row("PhysicsJointStateAPI", _EXACT, "state:*:physics:position", "where the joint is at first"),
    Row("PhysicsJointStateAPI", _OUT, "state:*:physics:velocity", _START),
    Row("PhysxCollisionAPI", _EXACT, "physxCollision:contactOffset"),
    Row("PhysxCollisionAPI", _OUT, "physxCollision:*", _SOLVER),
    Row("PhysxMaterialAPI", _OUT, "physxMaterial:*", "two surfaces have the larger friction, and restitution"),
    Row("PhysxLimitAPI", _OUT, "physxLimit:*", "limits are as stiff as the engine has them"),
    Row("isaac", _IDLE, "isaac:*", "names and lists of Isaac Sim"),
    # ------------------------------------------------------------------ as MuJoCo and Newton write them
    *(
        Row(kind, _IDLE)
        for kind in (
            "MjcSceneAPI MjcJointAPI MjcCollisionAPI MjcMaterialAPI MjcBodyAPI MjcImageableAPI "
            "MjcMeshCollisionAPI NewtonJointAPI NewtonMaterialAPI NewtonMimicAPI NewtonArticulationRootAPI "
            "NewtonCollisionAPI NewtonMeshCollisionAPI NewtonSceneAPI NewtonMassAPI"
        ).split()
    ),
    *(Row(kind, _EXACT, "", "a frame") for kind in ("MjcSiteAPI", "NewtonSiteAPI")),
    Row("MjcSceneAPI", _EXACT, "mjc:option:timestep mjc:option:cone mjc:option:impratio", "of a world"),
    Row("MjcSceneAPI", _OUT, "mjc:option:* mjc:flag:* mjc:compiler:*", _SOLVER),
    Row("MjcJointAPI", _EXACT, "mjc:armature mjc:damping mjc:frictionloss mjc:stiffness"),
    Row("MjcJointAPI", _EXACT, "mjc:springref", "in degrees, where it turns"),
    Row("MjcJointAPI", _OUT, "mjc:*", _SOLVER),
    Row("MjcImageableAPI", _IDLE, "mjc:group"),
    Row("MjcActuator", _ABOUT, "", "one with dynamics, or of what is no joint, is left out, with a note"),
    Row("MjcActuator", _EXACT, "mjc:target mjc:gear mjc:gainPrm mjc:biasPrm mjc:gainType mjc:biasType mjc:dynType"),
    Row("MjcActuator", _EXACT, "mjc:forceLimited mjc:forceRange:min mjc:forceRange:max"),
    Row("MjcActuator", _ABOUT, "mjc:ctrlLimited mjc:ctrlRange:min mjc:ctrlRange:max", "of a motor, its effort limit"),
    *(Row(kind, _OUT, "", "it is MuJoCo's alone") for kind in ("MjcTendon", "MjcKeyframe", "MjcSensor")),
    *(
        Row(kind, _OUT, "", "ties of a file are left out")
        for kind in ("MjcEqualityAPI", "MjcEqualityConnectAPI", "MjcEqualityWeldAPI")
    ),
    Row("MjcEqualityJointAPI", _EXACT),
    Row("MjcEqualityJointAPI", _EXACT, "mjc:coef0 mjc:coef1"),
    Row("MjcEqualityJointAPI", _OUT, "mjc:coef2 mjc:coef3 mjc:coef4", "joints follow in proportion"),
    Row("NewtonJointAPI", _EXACT, "newton:armature newton:friction"),
    Row("NewtonJointAPI", _EXACT, "newton:damping newton:velocityLimit", "in degrees, where it turns"),
    Row("NewtonMaterialAPI", _EXACT, "newton:torsionalFriction newton:rollingFriction"),
    Row(
        "NewtonMimicAPI", _EXACT, "newton:mimicJoint newton:mimicCoef0 newton:mimicCoef1", "in degrees, where it turns"
    ),
    Row("NewtonMimicAPI", _IDLE, "newton:mimicEnabled"),
    Row("NewtonJointAPI", _OUT, "newton:*", _SOLVER),
    # ------------------------------------------------------------------ as anysim writes them
    Row("anysim", _EXACT, "anysim:*", "in double precision, where the file's own number rounds to the same"),
)
"""What is not here is left out with a note."""

JOINTS = frozenset(
    ("PhysicsFixedJoint", "PhysicsRevoluteJoint", "PhysicsPrismaticJoint", "PhysicsSphericalJoint", "PhysicsJoint")
)
_WHOLE: Mapping[str, Row] = {row.path: row for row in ROWS if not row.attributes}
_NAMES = [(name, row) for row in ROWS for name in row.attributes.split() if row.path not in ("stage",)]
_EXACTLY: Mapping[str, Row] = {n: row for n, row in reversed(_NAMES) if "*" not in n and row.path != "joint"}
_OF_JOINTS: Mapping[str, Row] = {n: row for n, row in _NAMES if row.path == "joint"}
_PATTERNS = sorted(
    ((re.compile(re.escape(name).replace(r"\*", ".+")), row) for name, row in _NAMES if "*" in name),
    key=lambda pair: -len(pair[0].pattern),
)


def rows() -> Iterator[tuple[str, str, Fate, str]]:
    """The table for readers: schema, attributes, what becomes of them, and how or why."""
    for row in ROWS:
        yield row.path, row.attributes, row.fate, row.text


def schema(name: str) -> Row | None:
    """What becomes of a type of prim, or of a schema without the name of its instance."""
    return _WHOLE.get(name)


def attribute(name: str, kind: str = "") -> Row | None:
    """What becomes of an attribute or a relationship of a prim of some type."""
    if name in _OF_JOINTS and (kind.endswith("Joint") or name not in _EXACTLY):
        return _OF_JOINTS[name]
    if name in _EXACTLY:
        return _EXACTLY[name]
    return next((row for pattern, row in _PATTERNS if pattern.fullmatch(name)), None)
