"""The writer of USD files: a world, or one tree, as UsdPhysics.

Places are doubles. Of what the schemas have in single precision every digit is in an attribute `anysim:NAME` beside it,
which the importer takes where both say the same, and which others pass over. What the schemas have no word for is said
as PhysX and MuJoCo say it, where these do.
"""

import re
from collections.abc import Sequence
from math import degrees, inf, radians
from pathlib import Path
from typing import Any

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.errors import AnysimError
from anysim.kinematics import inertia
from anysim.math import pose as P
from anysim.model.shapes import ORDINARY
from anysim.model.world import (
    Body,
    BodyKind,
    Box,
    Capsule,
    Cylinder,
    Geom,
    Joint,
    JointType,
    Mesh,
    MeshShape,
    Plane,
    Sphere,
    Surface,
    World,
)
from anysim_export_model.common import check_joint, looks, never_written, unknown_parts
from anysim_export_model.notes import Notes
from anysim_export_model.scene import Piece, Scene
from anysim_usd.library import pxr, quiet
from anysim_usd.writing.stage import StageWriter

_LARGEST = 1e6  # [m] of a plane that has no end


def write_usd(scene: Scene, folder: Path, notes: Notes) -> tuple[Path, ...]:
    """Write a scene as one .usda file into a folder, and note what is not in it.

    Raises:
        AssetError: usd-core is not installed.
        AnysimError: something that USD cannot say.
    """
    with quiet():
        text = _UsdWriter(scene, notes).text()
    path = folder / (re.sub(r"[^\w.-]", "_", scene.name).strip(".") + ".usda")
    path.write_text(text, encoding="utf-8")
    return (path,)


class _UsdWriter:
    def __init__(self, scene: Scene, notes: Notes) -> None:
        self.scene, self.notes = scene, notes
        self.out = StageWriter(scene.name)
        self.top = str(self.out.root.GetPath())
        self.prims: list[dict[int, str]] = []
        self.materials: dict[Any, str] = {}

    def text(self) -> str:
        alone = len(self.scene.pieces) == 1 and self.scene.world is None
        for piece in self.scene.pieces:
            never_written(piece, self.notes)
            self._piece(piece, self.out.root if alone else self.out.define(self.top, piece.name, "Xform"))
        if self.scene.world is not None:
            self._around(self.scene.world)
        for first, second in self.scene.apart:
            self._keep_apart(first, second)
        return self.out.text()

    # ------------------------------------------------------------------ trees

    def _piece(self, piece: Piece, root: Any) -> None:
        model, out, base = piece.model, self.out, str(root.GetPath())
        pxr().Usd.ModelAPI(root).SetKind("component")
        self._never(piece)
        poses = self._initial(piece)
        known = {mesh.name: mesh for mesh in model.meshes}
        paths: dict[int, str] = {}
        self.prims.append(paths)
        for index, body in enumerate(model.bodies):
            prim = out.define(base, body.name, "Xform")
            paths[index] = str(prim.GetPath())
            out.place(prim, poses[index][:3], poses[index][3:])
            self._mass(prim, body)
            out.apply(prim, "PhysicsRigidBodyAPI")
            if body.gravity_compensation:
                out.apply(prim, "PhysxRigidBodyAPI")
                out.put(prim, "physxRigidBody:disableGravity", "Bool", True)
            for name, rate in zip(("linear", "angular"), body.damping, strict=True):
                if rate:
                    out.put(prim, f"physxRigidBody:{name}Damping", "Float", rate)
        for geom in model.geoms:
            self._geom(paths[geom.body], geom, known)
        for site in model.sites:
            prim = out.define(paths[site.body], site.name, "Xform")
            out.apply(prim, "MjcSiteAPI")
            out.place(prim, site.position, site.quaternion)
            out.exact(prim, "frame", (*site.position, *site.quaternion))
        joints = ""
        if model.joints or piece.root is not BodyKind.FREE:
            joints = str(out.define(base, "joints", "Scope").GetPath())
        if piece.root is not BodyKind.FREE:
            tie = out.define(joints, "root_joint", "PhysicsFixedJoint")
            self._ends(tie, "", paths[0], poses[0], P.pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
        if model.joints:
            out.apply(root, "PhysicsArticulationRootAPI")
        found: list[Any] = []
        for joint in model.joints:
            check_joint(joint, "USD")
            found.append(self._joint(joints, joint, model.bodies[joint.body], paths))
        for joint, prim in zip(model.joints, found, strict=True):
            if joint.mimic is not None:
                self._mimic(prim, joint, model.joints[joint.mimic.joint], found[joint.mimic.joint])
        for hint in model.actuator_hints:
            if hint.shares:
                self.notes.lost("drive of a tendon", "is left out", model.joints[hint.joint].name)
            else:
                self._drive(found[hint.joint], model.joints[hint.joint], hint)
        driven = {hint.joint for hint in model.actuator_hints if not hint.shares}
        for number, joint in enumerate(model.joints):
            if number not in driven and joint.effort_limit != inf:
                self._undriven(found[number], joint)
        for low, high in sorted(model.excluded_pairs):
            self._filter(paths[low], paths[high])

    def _never(self, piece: Piece) -> None:
        for what, parts in (
            ("tendon", piece.model.tendons),
            ("tendon", piece.model.spatial_tendons),
            ("constraint", piece.model.constraints),
            ("height field", piece.model.heightfields),
        ):
            for part in parts:
                self.notes.lost(what, "is left out: USD has no such thing", part.name)

    def _initial(self, piece: Piece) -> list[Array]:
        """Where the bodies are (7,) at first, in the world."""
        found: list[Array] = []
        joints = {joint.body: joint for joint in piece.model.joints}
        for index, body in enumerate(piece.model.bodies):
            if index == 0:
                found.append(P.pose(piece.position, piece.quaternion))
                continue
            here = P.compose(found[body.parent], P.pose(body.position, body.quaternion))
            joint = joints[index]
            axis, anchor = np.array(joint.axis), np.array(joint.anchor)
            if joint.type is JointType.REVOLUTE:
                turn = P.from_axis_angle(axis, np.array(joint.initial))
                moved = P.pose(anchor - P.rotate(turn, anchor), turn)
            else:
                moved = P.pose(axis * joint.initial, (0.0, 0.0, 0.0, 1.0))
            found.append(P.compose(here, moved))
        return found

    def _mass(self, prim: Any, body: Body) -> None:
        own, out, lib = body.inertial, self.out, pxr()
        if own.mass <= 0:
            if body.kind is not BodyKind.STATIC:
                raise AnysimError(f"body '{body.name}' moves and has no mass, which USD files cannot say")
            return
        out.apply(prim, "PhysicsMassAPI")
        out.single(prim, "physics:mass", "mass", own.mass)
        out.put(prim, "physics:centerOfMass", "Point3f", lib.Gf.Vec3f(*own.com))
        out.exact(prim, "centerOfMass", own.com)
        if not any(own.inertia):
            return
        found = inertia.principal(own.inertia)
        moments = [max(float(m), 0.0) for m in found.moments]
        x, y, z, w = (float(v) for v in found.frame)
        out.put(prim, "physics:diagonalInertia", "Float3", lib.Gf.Vec3f(*moments))
        out.put(prim, "physics:principalAxes", "Quatf", lib.Gf.Quatf(w, x, y, z))
        out.exact(prim, "inertia", own.inertia)

    # ------------------------------------------------------------------ joints

    def _ends(self, prim: Any, first: str, second: str, here: Array, there: Array) -> None:
        lib = pxr()
        for side, target, pose in (("0", first, here), ("1", second, there)):
            if target:
                prim.CreateRelationship(f"physics:body{side}", False).SetTargets([target])
            x, y, z, w = (float(v) for v in pose[3:])
            self.out.put(prim, f"physics:localPos{side}", "Point3f", lib.Gf.Vec3f(*[float(v) for v in pose[:3]]))
            self.out.put(prim, f"physics:localRot{side}", "Quatf", lib.Gf.Quatf(w, x, y, z))

    def _joint(self, base: str, joint: Joint, body: Body, paths: dict[int, str]) -> Any:
        out, turns = self.out, joint.type is JointType.REVOLUTE
        unit = radians(1.0) if turns else 1.0
        prim = out.define(base, joint.name, "PhysicsRevoluteJoint" if turns else "PhysicsPrismaticJoint")
        second = P.pose(joint.anchor, _toward(np.array(joint.axis)))
        rest = P.pose(body.position, body.quaternion)
        self._ends(prim, paths[body.parent], paths[joint.body], P.compose(rest, second), second)
        out.put(prim, "physics:axis", "Token", "X")
        out.exact(prim, "rest", rest)
        out.exact(prim, "axis", joint.axis)
        out.exact(prim, "anchor", joint.anchor)
        for key, end in (("lower", joint.lower), ("upper", joint.upper)):
            if end not in (-inf, inf):
                out.put(prim, f"physics:{key}Limit", "Float", end / unit)
        if (joint.lower, joint.upper) != (-inf, inf):
            out.exact(prim, "limits", (joint.lower, joint.upper))
        if joint.initial:
            kind = "angular" if turns else "linear"
            out.apply(prim, f"PhysicsJointStateAPI:{kind}")
            out.single(prim, f"state:{kind}:physics:position", "initial", joint.initial, unit)
        self._passive(prim, joint, unit)
        return prim

    def _passive(self, prim: Any, joint: Joint, unit: float) -> None:
        out = self.out
        if joint.velocity_limit != inf or joint.armature:
            out.apply(prim, "PhysxJointAPI")
        if joint.velocity_limit != inf:
            out.single(prim, "physxJoint:maxJointVelocity", "velocityLimit", joint.velocity_limit, unit)
        if joint.armature:
            out.single(prim, "physxJoint:armature", "armature", joint.armature)
        mjc = {"damping": joint.damping, "frictionloss": joint.friction, "stiffness": joint.stiffness}
        if any(mjc.values()):
            out.apply(prim, "MjcJointAPI")
        for name, value in mjc.items():
            if value:
                out.put(prim, f"mjc:{name}", "Double", value)
        if joint.stiffness:
            out.put(prim, "mjc:springref", "Double", joint.spring_rest / unit)
            out.exact(prim, "springRest", joint.spring_rest)
        if joint.limit_softness:
            out.exact(prim, "limitSoftness", joint.limit_softness)
        for what in ("limit_compliance", "friction_compliance", "mimic_compliance"):
            if getattr(joint, what) is not None:
                self.notes.lost(what.replace("_", " "), "is left out: solvers are the engine's", joint.name)

    def _mimic(self, prim: Any, joint: Joint, leader: Joint, target: Any) -> None:
        assert joint.mimic is not None
        out, mimic = self.out, joint.mimic
        unit, their = (radians(1.0) if j.type is JointType.REVOLUTE else 1.0 for j in (joint, leader))
        if mimic.curve:
            self.notes.lost("curve of a mimic", "is left out: it follows in proportion", joint.name)
        axis = "rotX" if joint.type is JointType.REVOLUTE else "transX"
        out.apply(prim, f"PhysxMimicJointAPI:{axis}")
        prim.CreateRelationship(f"physxMimicJoint:{axis}:referenceJoint", False).SetTargets([target.GetPath()])
        out.put(prim, f"physxMimicJoint:{axis}:gearing", "Float", -mimic.multiplier * their / unit)
        out.put(prim, f"physxMimicJoint:{axis}:offset", "Float", -mimic.offset / unit)
        out.exact(prim, "mimic", (mimic.multiplier, mimic.offset))

    def _drive(self, prim: Any, joint: Joint, hint: Any) -> None:
        out, turns = self.out, joint.type is JointType.REVOLUTE
        kind, per = ("angular", degrees(1.0)) if turns else ("linear", 1.0)
        out.apply(prim, f"PhysicsDriveAPI:{kind}")
        out.single(prim, f"drive:{kind}:physics:stiffness", "driveStiffness", hint.kp, per)
        out.single(prim, f"drive:{kind}:physics:damping", "driveDamping", hint.kd, per)
        if hint.effort_limit != inf:
            out.single(prim, f"drive:{kind}:physics:maxForce", "driveLimit", hint.effort_limit)
        if hint.effort_limit != joint.effort_limit:
            out.exact(prim, "driveLimit", hint.effort_limit)
            out.exact(prim, "effortLimit", joint.effort_limit)

    def _undriven(self, prim: Any, joint: Joint) -> None:
        """The effort limit of a joint without a drive is that of one that does nothing, as others have it."""
        kind = "angular" if joint.type is JointType.REVOLUTE else "linear"
        self.out.apply(prim, f"PhysicsDriveAPI:{kind}")
        self.out.single(prim, f"drive:{kind}:physics:maxForce", "effortLimit", joint.effort_limit)
        self.out.put(prim, "anysim:undriven", "Bool", True)

    # ------------------------------------------------------------------ shapes

    def _geom(self, base: str, geom: Geom, known: dict[str, Mesh]) -> None:
        if not geom.collides and not geom.visible:
            self.notes.lost("geom", "is left out: it is neither seen nor touched", geom.name)
            return
        looks(geom, self.notes)
        prim = self._shape(base, geom, known)
        if prim is None:
            return
        out, lib = self.out, pxr()
        if not prim.GetAttribute("anysim:name"):
            out.put(prim, "anysim:name", "String", geom.name)
        gprim = lib.UsdGeom.Gprim(prim)
        gprim.CreateDisplayColorAttr([lib.Gf.Vec3f(*geom.color[:3])])
        if geom.color[3] != 1.0:
            gprim.CreateDisplayOpacityAttr([geom.color[3]])
        if not geom.visible:
            lib.UsdGeom.Imageable(prim).CreatePurposeAttr("guide")
        if geom.collides:
            out.apply(prim, "PhysicsCollisionAPI")
            if isinstance(geom.shape, MeshShape):
                out.apply(prim, "PhysicsMeshCollisionAPI")
                approximation = "none" if geom.shape.concave else "convexHull"
                out.put(prim, "physics:approximation", "Token", approximation)
            self._surface(prim, geom.surface, geom.name)

    def _shape(self, base: str, geom: Geom, known: dict[str, Mesh]) -> Any:
        out, lib, shape = self.out, pxr(), geom.shape
        kinds = {
            Box: "Cube",
            Sphere: "Sphere",
            Cylinder: "Cylinder",
            Capsule: "Capsule",
            Plane: "Plane",
            MeshShape: "Mesh",
        }
        if type(shape) not in kinds:
            self.notes.lost("height field", "is left out: USD has no such shape", geom.name)
            return None
        prim = out.define(base, geom.name, kinds[type(shape)])
        match shape:
            case Box(half):
                out.put(prim, "size", "Double", 2.0)
                out.place(prim, geom.position, geom.quaternion, np.array(half))
                return prim
            case Sphere(radius):
                out.put(prim, "radius", "Double", radius)
            case Cylinder(radius, half) | Capsule(radius, half):
                out.put(prim, "radius", "Double", radius)
                out.put(prim, "height", "Double", 2 * half)
                out.put(prim, "axis", "Token", "Z")
            case Plane(extent):
                out.put(prim, "width", "Double", min(2 * extent, _LARGEST))
                out.put(prim, "length", "Double", min(2 * extent, _LARGEST))
                out.put(prim, "axis", "Token", "Z")
            case MeshShape(name):
                mesh = known[name]
                faces = np.asarray(mesh.faces, dtype=np.int32)
                made = lib.UsdGeom.Mesh(prim)
                made.CreatePointsAttr(
                    lib.Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(mesh.vertices, dtype=np.float32))
                )
                made.CreateFaceVertexCountsAttr([3] * len(faces))
                made.CreateFaceVertexIndicesAttr(lib.Vt.IntArray.FromNumpy(np.ascontiguousarray(faces.ravel())))
                made.CreateSubdivisionSchemeAttr("none")
                self.notes.changed("mesh", "has points of single precision", geom.name)
            case _:
                raise AssertionError(shape)
        out.place(prim, geom.position, geom.quaternion)
        return prim

    def _surface(self, prim: Any, surface: Surface, name: str) -> None:
        if surface == ORDINARY:
            return
        usual = Surface()
        key = (
            surface.friction,
            surface.restitution,
            surface.torsional_friction,
            surface.rolling_friction,
            surface.torsional,
        )
        if key[:2] != (usual.friction, usual.restitution) or key[2:] != (
            usual.torsional_friction,
            usual.rolling_friction,
            usual.torsional,
        ):
            if key not in self.materials:
                self.materials[key] = self._material(surface)
            shade = pxr().UsdShade
            bound = shade.Material.Get(self.out.stage, self.materials[key])
            shade.MaterialBindingAPI.Apply(prim).Bind(bound, shade.Tokens.weakerThanDescendants, "physics")
        if surface.contact_offset is not None:
            self.out.apply(prim, "PhysxCollisionAPI")
            self.out.put(prim, "physxCollision:contactOffset", "Float", surface.contact_offset)
        if (
            surface.softness
            or surface.impedance != usual.impedance
            or surface.compliance is not None
            or surface.priority
        ):
            self.notes.lost("softness of a contact", "is left out: solvers are the engine's", name)

    def _material(self, surface: Surface) -> str:
        prim = self.out.define(self.top, f"surface_{len(self.materials)}", "Material")
        self.out.apply(prim, "PhysicsMaterialAPI")
        for key, value in (("static", surface.friction), ("dynamic", surface.friction)):
            self.out.put(prim, f"physics:{key}Friction", "Float", value)
        self.out.put(prim, "physics:restitution", "Float", surface.restitution)
        if surface.torsional:
            self.out.put(prim, "newton:torsionalFriction", "Float", surface.torsional_friction)
        if surface.rolling_friction != Surface().rolling_friction:
            self.out.put(prim, "newton:rollingFriction", "Float", surface.rolling_friction)
        return str(prim.GetPath())

    # ------------------------------------------------------------------ the world around them

    def _keep_apart(self, first: tuple[int, int], second: tuple[int, int]) -> None:
        if WORLD in (first[1], second[1]):
            self.notes.lost("pair with what is fixed to the world", "is left out", self.scene.name)
            return
        self._filter(self.prims[first[0]][first[1]], self.prims[second[0]][second[1]])

    def _filter(self, first: str, second: str) -> None:
        prim = self.out.stage.GetPrimAtPath(first)
        self.out.apply(prim, "PhysicsFilteredPairsAPI")
        prim.CreateRelationship("physics:filteredPairs", False).AddTarget(second)

    def _around(self, world: World) -> None:
        out, lib, notes = self.out, pxr(), self.notes
        unknown_parts(world, notes, world.name)
        scene = out.define(self.top, "physics_scene", "PhysicsScene")
        gravity = np.array(world.physics.gravity)
        size = float(np.linalg.norm(gravity))
        down = gravity / size if size > 0 else np.array([0.0, 0.0, -1.0])
        out.put(scene, "physics:gravityDirection", "Vector3f", lib.Gf.Vec3f(*[float(v) for v in down]))
        out.put(scene, "physics:gravityMagnitude", "Float", size)
        out.exact(scene, "gravity", world.physics.gravity)
        out.apply(scene, "MjcSceneAPI")
        out.put(scene, "mjc:option:timestep", "Double", world.physics.dt)
        out.put(scene, "mjc:option:cone", "Token", world.physics.friction_cone)
        out.put(scene, "mjc:option:impratio", "Double", world.physics.impratio)
        known = {mesh.name: mesh for mesh in world.meshes}
        for geom in self.scene.fixed_geoms:
            self._geom(self.top, geom, known)
        for site in self.scene.fixed_sites:
            notes.lost("frame of the world", "is left out", site.name)
        for light in world.lights:
            self._light(light)
        for camera in world.cameras:
            self._camera(world, camera)
        absent: Sequence[tuple[str, Sequence[str]]] = (
            ("contact sensor", [sensor.name for sensor in world.contact_sensors]),
            ("tiled ground", ["the level of a tile"] if world.tiles else []),
            ("choice of assets", [slot.name for slot in world.slots if len(slot.entities) > 1]),
            ("control step", [f"{world.physics.control_dt:g} s"]),
        )
        for what, names in absent:
            for name in names:
                notes.lost(what, "is left out", name)

    def _light(self, light: Any) -> None:
        out, lib = self.out, pxr()
        prim = out.define(self.top, light.name, "DistantLight" if light.position is None else "SphereLight")
        turn = _between(np.array([0.0, 0.0, -1.0]), np.array(light.direction, dtype=float))
        out.place(prim, light.position or (0.0, 0.0, 0.0), turn)
        out.put(prim, "inputs:color", "Color3f", lib.Gf.Vec3f(*light.color))
        out.put(prim, "inputs:intensity", "Float", light.intensity)
        out.exact(prim, "intensity", light.intensity)

    def _camera(self, world: World, camera: Any) -> None:
        out, lib = self.out, pxr()
        base = self.top
        if camera.body != WORLD:
            number = world.body_entity[camera.body]
            piece = next((i for i, p in enumerate(self.scene.pieces) if p.name == world.entities[number].name), None)
            if piece is None:
                return
            base = self.prims[piece][camera.body - world.entities[number].body_start]
        prim = out.define(base, camera.name, "Camera")
        turn = P.multiply(np.array(camera.quaternion), np.array([1.0, 0.0, 0.0, 0.0]))
        out.place(prim, camera.position, turn)
        high = 20.0
        out.put(prim, "verticalAperture", "Float", high)
        out.put(prim, "horizontalAperture", "Float", high * camera.width / camera.height)
        out.put(prim, "focalLength", "Float", high / 2 / np.tan(radians(camera.fov) / 2))
        out.put(prim, "clippingRange", "Float2", lib.Gf.Vec2f(camera.near, camera.far))
        out.exact(prim, "fov", camera.fov)
        out.exact(prim, "size", (camera.width, camera.height))
        if camera.look_at is not None:
            self.notes.lost("camera", "does not look at anything by itself", camera.name)


def _toward(axis: Array) -> Array:
    """A turn (4,) that takes x to an axis."""
    return _between(np.array([1.0, 0.0, 0.0]), axis)


def _between(start: Array, end: Array) -> Array:
    """The shortest turn (4,) that takes one direction to another."""
    end = end / np.linalg.norm(end)
    cosine = float(P.dot(start, end))
    if cosine < -1.0 + 1e-9:
        across = np.eye(3)[int(np.argmin(np.abs(start)))]
        axis = np.cross(start, across)
        return np.array([*(axis / np.linalg.norm(axis)), 0.0])
    found = np.array([*np.cross(start, end), 1.0 + cosine])
    return found / np.linalg.norm(found)
