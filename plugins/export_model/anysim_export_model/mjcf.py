"""A world, or one tree, as an MJCF file."""

from collections.abc import Callable, Iterable
from math import inf, isinf
from typing import Any

import numpy as np

from anysim.conventions import WORLD, Array, wxyz_from_xyzw
from anysim.kinematics import inertia
from anysim.math import pose as P
from anysim.model.world import (
    FAR,
    Body,
    BodyKind,
    Box,
    Capsule,
    Compliance,
    ControlMode,
    Cylinder,
    Geom,
    HeightField,
    HeightFieldShape,
    Joint,
    JointType,
    Mesh,
    MeshShape,
    Plane,
    Shape,
    Sphere,
    Surface,
    World,
)
from anysim_export_model.common import check_joint, looks, never_written, unknown_parts
from anysim_export_model.mesh_files import MeshFiles
from anysim_export_model.notes import Notes
from anysim_export_model.scene import Piece, Scene
from anysim_export_model.xml import document, named, number, numbers, sub

_SEEN, _COLLIDING, _BOTH = "2", "3", "0"  # groups of geoms
_OPTICAL = np.array([1.0, 0.0, 0.0, 0.0])  # from x right, y down, z ahead to x right, y up, z back
_BASE = 0.1  # [m] below the lowest point of a height field


def mjcf(scene: Scene, meshes: MeshFiles, notes: Notes) -> bytes:
    """The MJCF file of a scene; its meshes are written when they are met."""
    return _Mjcf(scene, meshes, notes).document()


class _Mjcf:
    def __init__(self, scene: Scene, meshes: MeshFiles, notes: Notes) -> None:
        self.scene, self.meshes, self.notes = scene, meshes, notes
        self.alone = len(scene.pieces) == 1
        self.root = root = named("mujoco", model=scene.name)
        sub(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false")
        self.option = sub(root, "option")
        self.assets = sub(root, "asset")
        self.world = sub(root, "worldbody")
        self.contact, self.equality, self.actuator = (sub(root, tag) for tag in ("contact", "equality", "actuator"))
        self.files: dict[str, str] = {}
        self.fields: set[str] = set()
        self.positions: list[float] = []
        self.moved = False

    def document(self) -> bytes:
        for piece in self.scene.pieces:
            never_written(piece, self.notes)
            self._piece(piece)
        if self.scene.world is not None:
            self._around(self.scene.world)
        for first, second in self.scene.apart:
            self._exclude(self._body_of(first), self._body_of(second))
        if self.moved:
            sub(sub(self.root, "keyframe"), "key", name="home", qpos=numbers(self.positions))
        for part in [part for part in self.root if not len(part) and not part.attrib]:
            self.root.remove(part)
        return document(self.root)

    def _name(self, piece: Piece, name: str) -> str:
        if self.alone:
            return f"{name} (body)" if name == "world" else name
        return name if name == piece.name else f"{piece.name}.{name}"

    def _body_of(self, place: tuple[int, int]) -> str:
        if place[1] == WORLD:
            return "world"
        piece = self.scene.pieces[place[0]]
        return self._name(piece, piece.model.bodies[place[1]].name)

    def _exclude(self, first: str, second: str) -> None:
        sub(self.contact, "exclude", body1=first, body2=second)

    # ------------------------------------------------------------------ trees

    def _piece(self, piece: Piece) -> None:
        model, full = piece.model, lambda name: self._name(piece, name)
        joints = {joint.body: joint for joint in model.joints}
        known, fields = {m.name: m for m in model.meshes}, {f.name: f for f in model.heightfields}
        elements: list[Any] = []
        for index, body in enumerate(model.bodies):
            parent = self.world if index == 0 else elements[body.parent]
            place = (piece.position, piece.quaternion) if index == 0 else (body.position, body.quaternion)
            if self.alone and body.name == "world":
                self.notes.changed("body", f"is called '{full(body.name)}': MuJoCo's own has its name", body.name)
            element = sub(parent, "body", name=full(body.name), pos=numbers(place[0]), quat=_quat(place[1]))
            elements.append(element)
            if body.gravity_compensation:
                element.set("gravcomp", "1")
            _inertial(element, body)
            if index == 0 and piece.root is BodyKind.FREE:
                element.insert(0, named("freejoint", name=full(f"{body.name} (free)")))
                self.positions += [*piece.position, *wxyz_from_xyzw(np.array(piece.quaternion)).tolist()]
            elif index in joints:
                check_joint(joints[index], "MJCF")
                self._joint(element, joints[index], full)
            own = [geom for geom in model.geoms if geom.body == index]
            for geom in own:
                self._geom(element, geom, full, known, fields)
            for site in model.sites:
                if site.body == index:
                    name = full(site.name)
                    sub(element, "site", name=name, pos=numbers(site.position), quat=_quat(site.quaternion))
            if body.parent == 0 and model.bodies[0].kind is not BodyKind.FREE and piece.root is not BodyKind.FREE:
                # MuJoCo lets bodies meet what stands still and carries them
                self._exclude(full(model.bodies[0].name), full(body.name))
        for joint in model.joints:
            if joint.mimic is not None:
                leader = full(model.joints[joint.mimic.joint].name)
                line = numbers((joint.mimic.offset, joint.mimic.multiplier, *(*joint.mimic.curve, 0.0, 0.0, 0.0)[:3]))
                sub(self.equality, "joint", joint1=full(joint.name), joint2=leader, polycoef=line)
        for low, high in sorted(model.excluded_pairs):
            self._exclude(full(model.bodies[low].name), full(model.bodies[high].name))
        for hint in model.actuator_hints:
            joint = model.joints[hint.joint]
            limit = {} if isinf(hint.effort_limit) else {"forcerange": numbers((-hint.effort_limit, hint.effort_limit))}
            own_name = full(joint.name)
            if hint.mode is ControlMode.POSITION:
                gains = {"kp": number(hint.kp), "kv": number(hint.kd)}
                sub(self.actuator, "position", name=own_name, joint=own_name, **gains, **limit)
            elif hint.mode is ControlMode.VELOCITY:
                sub(self.actuator, "velocity", name=own_name, joint=own_name, kv=number(hint.kd), **limit)
            else:
                sub(self.actuator, "motor", name=own_name, joint=own_name, **limit)

    def _joint(self, element: Any, joint: Joint, full: Callable[[str], str]) -> None:
        made = named("joint", name=full(joint.name))
        element.insert(0, made)
        made.set("type", "hinge" if joint.type is JointType.REVOLUTE else "slide")
        made.set("axis", numbers(joint.axis))
        made.set("pos", numbers(joint.anchor))
        ends = (max(joint.lower, -FAR), min(joint.upper, FAR))
        if ends != (-FAR, FAR):
            made.set("range", numbers(ends))
            if FAR in (-ends[0], ends[1]):
                self.notes.changed("limit on one side", f"is {FAR:g} on the other", joint.name)
        if joint.effort_limit != inf:
            made.set("actuatorfrcrange", numbers((-joint.effort_limit, joint.effort_limit)))
        values = {
            "damping": joint.damping,
            "frictionloss": joint.friction,
            "armature": joint.armature,
            "stiffness": joint.stiffness,
            "springref": joint.spring_rest if joint.stiffness else 0.0,
        }
        for key, value in values.items():
            if value:
                made.set(key, number(value))
        if joint.limit_softness:
            made.set("solreflimit", f"{number(joint.limit_softness)} 1")
        if joint.velocity_limit != inf:
            self.notes.lost("velocity limit of a joint", "is left out: MuJoCo has none", joint.name)
        self.positions.append(joint.initial)
        self.moved = self.moved or joint.initial != 0.0

    def _geom(
        self,
        element: Any,
        geom: Geom,
        full: Callable[[str], str],
        known: dict[str, Mesh],
        fields: dict[str, HeightField],
    ) -> None:
        if not geom.collides and not geom.visible:
            self.notes.lost("geom", "is left out: it is neither seen nor touched", geom.name)
            return
        looks(geom, self.notes)
        group = _SEEN if not geom.collides else _BOTH if geom.visible else _COLLIDING
        made = sub(element, "geom", name=full(geom.name), group=group, rgba=numbers(geom.color))
        made.set("pos", numbers(geom.position))
        made.set("quat", _quat(geom.quaternion))
        for key, text in self._shape(geom, known, fields).items():
            made.set(key, text)
        if isinstance(geom.shape, HeightFieldShape):
            low = float(np.min(fields[geom.shape.heightfield].heights))
            lift = P.rotate(np.array(geom.quaternion), np.array([0.0, 0.0, low]))
            made.set("pos", numbers(np.array(geom.position) + lift))
        if not geom.collides:
            made.set("contype", "0")
            made.set("conaffinity", "0")
        else:
            self._surface(made, geom.surface, geom.name)

    def _surface(self, made: Any, surface: Surface, name: str) -> None:
        friction = (surface.friction, surface.torsional_friction, surface.rolling_friction)
        made.set("friction", numbers(friction))
        own = surface.compliance or Compliance()
        made.set("condim", str(own.dimensions or (4 if surface.torsional else 3)))
        made.set("solimp", numbers(own.impedance or (*surface.impedance, 0.001, 0.5, 2.0)))
        if own.reference or surface.softness:
            made.set("solref", numbers(own.reference or (surface.softness, 1.0)))
        for key, value, usual in (("margin", own.margin, 0.0), ("gap", own.gap, 0.0), ("solmix", own.weight, 1.0)):
            if value != usual:
                made.set(key, number(value))
        if surface.priority:
            made.set("priority", str(surface.priority))
        if surface.restitution:
            self.notes.lost("restitution", "is left out: MuJoCo's contacts are damped springs", name)
        if surface.contact_offset is not None:
            self.notes.lost("contact offset", "is left out", name)

    def _shape(self, geom: Geom, known: dict[str, Mesh], fields: dict[str, HeightField]) -> dict[str, str]:
        shape: Shape = geom.shape
        match shape:
            case Box(half):
                return {"type": "box", "size": numbers(half)}
            case Sphere(radius):
                return {"type": "sphere", "size": number(radius)}
            case Cylinder(radius, half):
                return {"type": "cylinder", "size": numbers((radius, half))}
            case Capsule(radius, half):
                return {"type": "capsule", "size": numbers((radius, half))}
            case Plane(extent):
                return {"type": "plane", "size": numbers((extent, extent, 0.05))}
            case MeshShape(name, concave):
                if concave and geom.collides:
                    self.notes.changed("concave mesh", "collides as its convex hull", geom.name)
                if name not in self.files:
                    self.files[name] = self.meshes.file(known[name])
                    sub(self.assets, "mesh", name=name, file=self.files[name], inertia="shell")
                return {"type": "mesh", "mesh": name}
            case HeightFieldShape(name):
                self._heightfield(fields[name])
                return {"type": "hfield", "hfield": name}

    def _heightfield(self, field: HeightField) -> None:
        if field.name in self.fields:
            return
        self.fields.add(field.name)
        heights = np.asarray(field.heights, dtype=float)
        low, span = float(heights.min()), max(float(np.ptp(heights)), 1e-6)
        size = numbers((field.size[0] / 2, field.size[1] / 2, span, _BASE))
        rows, cols = heights.shape
        made = sub(self.assets, "hfield", name=field.name, nrow=str(rows), ncol=str(cols), size=size)
        made.set("elevation", numbers(((heights[::-1] - low) / span).ravel()))

    # ------------------------------------------------------------------ the world around them

    def _around(self, world: World) -> None:
        physics, notes = world.physics, self.notes
        unknown_parts(world, notes, world.name)
        self.option.set("timestep", number(physics.dt))
        self.option.set("gravity", numbers(physics.gravity))
        self.option.set("cone", physics.friction_cone)
        self.option.set("impratio", number(physics.impratio))
        self.option.set("integrator", "implicitfast")
        known, fields = {m.name: m for m in world.meshes}, {f.name: f for f in world.heightfields}
        for geom in self.scene.fixed_geoms:
            self._geom(self.world, geom, lambda name: name, known, fields)
        for site in self.scene.fixed_sites:
            sub(self.world, "site", name=site.name, pos=numbers(site.position), quat=_quat(site.quaternion))
        bodies = {element.get("name"): element for element in self.world.iter("body")}
        for camera in world.cameras:
            at = self.world if camera.body == WORLD else bodies[self._global(world, camera.body)]
            turn = P.multiply(np.array(camera.quaternion), _OPTICAL)
            made = sub(at, "camera", name=camera.name, pos=numbers(camera.position), quat=_quat(turn))
            made.set("fovy", number(camera.fov))
            made.set("resolution", f"{camera.width} {camera.height}")
            if camera.look_at is not None:
                notes.lost("camera", "does not look at anything by itself", camera.name)
        for light in world.lights:
            made = sub(self.world, "light", name=light.name, dir=numbers(light.direction))
            made.set("diffuse", numbers(light.intensity * part for part in light.color))
            if light.position is None:
                made.set("type", "directional")
            else:
                made.set("pos", numbers(light.position))
        for what, names in self._absent(world).items():
            for name in names:
                notes.lost(what, "is left out", name)

    def _global(self, world: World, body: int) -> str:
        entity = world.entities[world.body_entity[body]]
        name = world.bodies[body].name
        return name.removeprefix(f"{entity.name}.") if self.alone else name

    def _absent(self, world: World) -> dict[str, Iterable[str]]:
        return {
            "contact sensor": [sensor.name for sensor in world.contact_sensors],
            "tiled ground": ["the level of a tile"] if world.tiles else [],
            "choice of assets": [slot.name for slot in world.slots if len(slot.entities) > 1],
            "control step": [f"{world.physics.control_dt:g} s"],
        }


def _inertial(element: Any, body: Body) -> None:
    """Principal moments and axes: MuJoCo takes them as they are, also those of a body that does not move."""
    own = body.inertial
    if own.mass <= 0:
        return
    found = inertia.principal(own.inertia, descending=True)
    made = sub(element, "inertial", pos=numbers(own.com), quat=_quat(found.frame), mass=number(own.mass))
    made.set("diaginertia", numbers(found.moments))


def _quat(quaternion: Iterable[float] | Array) -> str:
    return numbers(wxyz_from_xyzw(np.array(tuple(quaternion))))
