"""One tree as a URDF file, and an SRDF file with its groups, its home and the pairs that never collide.

A joint of URDF turns about the origin of the link that it moves. Where the model's turns about another point, a link
`NAME.anchor` moves there, and carries the link `NAME` with its own frame.
"""

from math import inf, isinf
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.errors import AnysimError
from anysim.math import pose as P
from anysim.model.world import (
    FAR,
    BodyKind,
    Box,
    Capsule,
    ControlMode,
    Cylinder,
    Geom,
    Joint,
    JointType,
    MeshShape,
    Sphere,
)
from anysim_export_model.common import check_joint, free, is_ordinary, looks, never_written
from anysim_export_model.mesh_files import MeshFiles
from anysim_export_model.notes import Notes
from anysim_export_model.scene import Piece
from anysim_export_model.xml import document, named, number, numbers, sub


def urdf(piece: Piece, meshes: MeshFiles, notes: Notes) -> bytes:
    """The URDF file of a tree; its meshes are written when they are met."""
    return _Urdf(piece, meshes, notes).document()


class _Urdf:
    def __init__(self, piece: Piece, meshes: MeshFiles, notes: Notes) -> None:
        self.piece, self.model, self.meshes, self.notes = piece, piece.model, meshes, notes
        self.known = {mesh.name: mesh for mesh in piece.model.meshes}
        self.root = named("robot", name=piece.name)
        self.links = {body.name for body in self.model.bodies}
        self.joints = {joint.name for joint in self.model.joints}
        self.shift = [np.zeros(3) for _ in self.model.bodies]
        """Of each body, where the frame of its link is."""
        for joint in self.model.joints:
            if joint.type is JointType.REVOLUTE and any(joint.anchor):
                self.shift[joint.body] = np.array(joint.anchor)
        self.moving = [
            free(f"{body.name}.anchor", self.links) if shift.any() else body.name
            for body, shift in zip(self.model.bodies, self.shift, strict=True)
        ]

    def document(self) -> bytes:
        model, notes = self.model, self.notes
        never_written(self.piece, notes)
        if self.piece.root is BodyKind.FREE:
            notes.changed("free root", "is not in the file: its reader decides whether it floats", self.piece.name)
        if any(self.piece.position) or self.piece.quaternion[:3] != (0.0, 0.0, 0.0):
            place = numbers((*self.piece.position, *self.piece.quaternion))
            notes.changed("place", f"is not in the file: position and quaternion xyzw are {place}", self.piece.name)
        for number_, body in enumerate(model.bodies):
            if body.gravity_compensation:
                notes.lost("gravity compensation", "is left out", body.name)
            self._link(number_)
        for joint in model.joints:
            check_joint(joint, "URDF")
            self._joint(joint)
        for body, name, shift in zip(model.bodies, self.moving, self.shift, strict=True):
            if name != body.name:
                notes.changed("anchor of a joint", "is the origin of a link of its own, NAME.anchor", body.name)
                self._fixed(name, body.name, P.pose(-shift, (0.0, 0.0, 0.0, 1.0)))
        for site in model.sites:
            name = free(site.name, self.links)
            if name != site.name:
                notes.changed("frame", f"is called {name}: a link has its name", site.name)
            at = np.array(site.position) - self.shift[site.body]
            self._fixed(self.moving[site.body], name, P.pose(at, site.quaternion))
        for hint in model.actuator_hints:
            self._drive(hint)
        return document(self.root)

    # ------------------------------------------------------------------ links

    def _link(self, index: int) -> None:
        body, own = self.model.bodies[index], self.model.bodies[index].inertial
        link = sub(self.root, "link", name=self.moving[index])
        if own.mass > 0:
            element = sub(link, "inertial")
            sub(element, "origin", xyz=numbers(np.array(own.com) - self.shift[index]), rpy="0 0 0")
            sub(element, "mass", value=number(own.mass))
            keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
            sub(element, "inertia", **{key: number(v) for key, v in zip(keys, own.inertia, strict=True)})
        elif body.kind is BodyKind.LINK:
            raise AnysimError(f"body '{body.name}' moves and has no mass, which URDF files cannot say")
        for geom in self.model.geoms:
            if geom.body == index:
                self._geom(link, geom, self.shift[index])

    def _geom(self, link: Any, geom: Geom, shift: Array) -> None:
        looks(geom, self.notes)
        if geom.collides and not is_ordinary(geom):
            self.notes.lost("surface", "is left out: a URDF says nothing of friction and softness", geom.name)
        for tag in [tag for tag, on in (("visual", geom.visible), ("collision", geom.collides)) if on]:
            if not isinstance(geom.shape, Box | Sphere | Cylinder | Capsule | MeshShape):
                kind = type(geom.shape).__name__.removesuffix("Shape").lower()
                self.notes.lost(kind, "is left out: a URDF has no such shape", geom.name)
                return
            element = sub(link, tag, name=geom.name)
            at = np.array(geom.position) - shift
            sub(element, "origin", xyz=numbers(at), rpy=numbers(P.exact_roll_pitch_yaw(geom.quaternion)))
            self._shape(sub(element, "geometry"), geom)
            if tag == "visual":
                material = sub(element, "material", name=" ".join(f"{v:g}" for v in geom.color))
                sub(material, "color", rgba=numbers(geom.color))

    def _shape(self, element: Any, geom: Geom) -> None:
        match geom.shape:
            case Box(half):
                sub(element, "box", size=numbers(2 * v for v in half))
            case Sphere(radius):
                sub(element, "sphere", radius=number(radius))
            case Cylinder(radius, half):
                sub(element, "cylinder", radius=number(radius), length=number(2 * half))
            case Capsule(radius, half):
                self.notes.changed("capsule", "is in URDF 1.2, which not every reader knows", geom.name)
                sub(element, "capsule", radius=number(radius), length=number(2 * half))
            case MeshShape(name, concave):
                if concave and geom.collides:
                    self.notes.changed("concave mesh", "collides as its reader has it, often as its hull", geom.name)
                sub(element, "mesh", filename=self.meshes.file(self.known[name]))
            case _:
                raise AssertionError(geom.shape)

    def _fixed(self, parent: str, child: str, pose: Array) -> None:
        sub(self.root, "link", name=child)
        joint = sub(self.root, "joint", name=free(f"{child}.fixed", self.joints), type="fixed")
        self._ends(joint, parent, child, pose)

    def _ends(self, joint: Any, parent: str, child: str, pose: Array) -> None:
        sub(joint, "origin", xyz=numbers(pose[:3]), rpy=numbers(P.exact_roll_pitch_yaw(pose[3:])))
        sub(joint, "parent", link=parent)
        sub(joint, "child", link=child)

    # ------------------------------------------------------------------ joints

    def _joint(self, joint: Joint) -> None:
        body, notes = self.model.bodies[joint.body], self.notes
        rest = P.pose(body.position, body.quaternion)
        at = P.compose(rest, P.pose(self.shift[joint.body], (0.0, 0.0, 0.0, 1.0)))
        at[:3] -= self.shift[body.parent]
        ends = (max(joint.lower, -FAR), min(joint.upper, FAR))
        endless = ends == (-FAR, FAR)
        kind = "prismatic" if joint.type is JointType.PRISMATIC else "continuous" if endless else "revolute"
        element = sub(self.root, "joint", name=joint.name, type=kind)
        self._ends(element, self.moving[body.parent], self.moving[joint.body], at)
        sub(element, "axis", xyz=numbers(joint.axis))
        limit = sub(element, "limit", effort=_bound(joint.effort_limit), velocity=_bound(joint.velocity_limit))
        if not endless:
            limit.set("lower", number(ends[0]))
            limit.set("upper", number(ends[1]))
            if FAR in (-ends[0], ends[1]):
                notes.changed("limit on one side", f"is {FAR:g} on the other", joint.name)
        elif kind == "prismatic":
            notes.changed(
                "slide without limits", "has no `lower` and `upper`, which some readers take for 0", joint.name
            )
        if isinf(joint.effort_limit) or isinf(joint.velocity_limit):
            notes.changed("unlimited effort or velocity", "is 0 in the file, which stands for none", joint.name)
        if joint.damping or joint.friction:
            sub(element, "dynamics", damping=number(joint.damping), friction=number(joint.friction))
        if joint.mimic is not None:
            leader = self.model.joints[joint.mimic.joint].name
            ratio, offset = number(joint.mimic.multiplier), number(joint.mimic.offset)
            sub(element, "mimic", joint=leader, multiplier=ratio, offset=offset)
            if joint.mimic.curve:
                notes.lost("curve of a mimic", "is left out: it follows in proportion", joint.name)
        if joint.stiffness:
            spring = sub(self.root, "gazebo", reference=joint.name)
            sub(spring, "springStiffness").text = number(joint.stiffness)
            sub(spring, "springReference").text = number(joint.spring_rest)
            notes.changed("spring of a joint", "is in a <gazebo> element", joint.name)
        if joint.armature:
            notes.lost("armature of a joint", "is left out", joint.name)
        if joint.limit_softness:
            notes.lost("softness of a joint's limits", "is left out", joint.name)

    def _drive(self, hint: Any) -> None:
        joint = self.model.joints[hint.joint]
        if hint.mode is not ControlMode.EFFORT:
            self.notes.lost("gains of a drive", "are left out: a URDF has none", joint.name)
        if hint.effort_limit < joint.effort_limit:
            self.notes.lost("effort limit of a drive", "is left out: that of its joint is in the file", joint.name)


def _bound(value: float) -> str:
    return "0" if value == inf else number(value)


def srdf(piece: Piece) -> bytes | None:
    """The SRDF file of a tree: channels as groups, initial positions as `home`, pairs that never collide.

    None where there is nothing to say.
    """
    model, root = piece.model, named("robot", name=piece.name)
    for name, joints in piece.channels.items():
        group = sub(root, "group", name=name)
        for joint in joints:
            sub(group, "joint", name=joint)
    at_home = {joint.name: joint.initial for joint in model.joints if joint.mimic is None and joint.initial}
    if at_home:
        groups = {joint: name for name, joints in piece.channels.items() for joint in joints}
        for group_name in dict.fromkeys(groups.get(joint, "all") for joint in at_home):
            if group_name == "all" and "all" not in piece.channels:
                group = sub(root, "group", name="all")
                for joint in model.joints:
                    sub(group, "joint", name=joint.name)
            state = sub(root, "group_state", name="home", group=group_name)
            for joint, value in at_home.items():
                if groups.get(joint, "all") == group_name:
                    sub(state, "joint", name=joint, value=number(value))
    for low, high in sorted(model.excluded_pairs):
        pair = (model.bodies[low].name, model.bodies[high].name)
        sub(root, "disable_collisions", link1=pair[0], link2=pair[1], reason="Never")
    return document(root) if len(root) else None
