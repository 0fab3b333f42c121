"""Small Worlds by hand: a sketch collects parts, one call each, and gives the frozen World."""

from itertools import pairwise
from math import inf
from typing import Any

from anysim.conventions import IDENTITY_QUATERNION, WORLD
from anysim.model.shapes import solid_moments
from anysim.model.world import (
    Actuator,
    Body,
    BodyKind,
    Camera,
    Channel,
    ContactSensor,
    ControlMode,
    Entity,
    EntityKind,
    Geom,
    Inertial,
    Joint,
    JointType,
    Physics,
    Plane,
    Quat,
    Robot,
    Shape,
    Site,
    Surface,
    Vec3,
    World,
)

ORIGIN: Vec3 = (0.0, 0.0, 0.0)


def inertial(shape: Shape, mass: float, com: Vec3 = ORIGIN) -> Inertial:
    """Of a solid of even density; the inertia is about the centre of mass, wherever that is put."""
    return Inertial(mass, com, (*solid_moments(shape, mass), 0.0, 0.0, 0.0))


class Sketch:
    """Parts in the making. Every method that adds a body returns its index."""

    def __init__(self, name: str, dt: float = 0.002, gravity: Vec3 = (0.0, 0.0, -9.81)) -> None:
        self.name, self.physics = name, Physics(dt=dt, control_dt=10 * dt, gravity=gravity)
        self.bodies: list[Body] = []
        self.joints: list[Joint] = []
        self.geoms: list[Geom] = []
        self.sites: list[Site] = []
        self.actuators: list[Actuator] = []
        self.cameras: list[Camera] = []
        self.sensors: list[ContactSensor] = []
        self.more: dict[str, Any] = {}  # further fields of the World: meshes, height fields
        self._entities: list[tuple[str, EntityKind, int, int]] = []

    # ------------------------------------------------------------------ objects

    def ground(self, surface: Surface = Surface()) -> None:
        """An infinite plane at z = 0."""
        self.geoms.append(Geom("terrain", WORLD, Plane(), surface=surface))

    def free(
        self,
        name: str,
        shape: Shape,
        position: Vec3,
        mass: float = 1.0,
        *,
        quaternion: Quat = IDENTITY_QUATERNION,
        com: Vec3 = ORIGIN,
        surface: Surface = Surface(),
        collides: bool = True,
        inertia: Inertial | None = None,
    ) -> int:
        """A free object of one shape."""
        return self._object(
            BodyKind.FREE, name, shape, position, quaternion, inertia or inertial(shape, mass, com), surface, collides
        )

    def fixed(
        self,
        name: str,
        shape: Shape,
        position: Vec3,
        *,
        quaternion: Quat = IDENTITY_QUATERNION,
        surface: Surface = Surface(),
        collides: bool = True,
    ) -> int:
        """A static object of one shape."""
        return self._object(BodyKind.STATIC, name, shape, position, quaternion, Inertial(0.0), surface, collides)

    def _object(
        self,
        kind: BodyKind,
        name: str,
        shape: Shape,
        position: Vec3,
        quaternion: Quat,
        mass: Inertial,
        surface: Surface,
        collides: bool,
    ) -> int:
        self._entities.append((name, EntityKind.OBJECT, len(self.bodies), len(self.joints)))
        self.bodies.append(Body(name, kind, WORLD, position, quaternion, mass))
        body = len(self.bodies) - 1
        self.geoms.append(Geom(name, body, shape, surface=surface, collides=collides))
        return body

    # ------------------------------------------------------------------ robots

    def robot(self, name: str, position: Vec3 = ORIGIN, quaternion: Quat = IDENTITY_QUATERNION) -> int:
        """Begin a robot with a static base that has no shape; links follow."""
        self._entities.append((name, EntityKind.ROBOT, len(self.bodies), len(self.joints)))
        self.bodies.append(Body(f"{name}.base", BodyKind.STATIC, WORLD, position, quaternion))
        return len(self.bodies) - 1

    def link(
        self,
        name: str,
        parent: int,
        type: JointType,
        axis: Vec3,
        mass: Inertial,
        *,
        position: Vec3 = ORIGIN,
        quaternion: Quat = IDENTITY_QUATERNION,
        gravity_compensation: bool = False,
        **joint: Any,
    ) -> int:
        """A link of the latest robot and the joint that moves it, which has the link's name."""
        full = f"{self._entities[-1][0]}.{name}"
        self.bodies.append(Body(full, BodyKind.LINK, parent, position, quaternion, mass, gravity_compensation))
        body = len(self.bodies) - 1
        self.joints.append(Joint(full, body, type, axis, **joint))
        return body

    def drive(
        self, body: int, mode: ControlMode = ControlMode.POSITION, kp: float = 0.0, kd: float = 0.0, limit: float = inf
    ) -> int:
        """A drive on the joint that moves a link; returns the index of the actuator."""
        joint = next(i for i, j in enumerate(self.joints) if j.body == body)
        self.actuators.append(Actuator(self.joints[joint].name, joint, mode, kp, kd, limit))
        return len(self.actuators) - 1

    def shape(
        self, body: int, shape: Shape, position: Vec3 = ORIGIN, surface: Surface = Surface(), collides: bool = True
    ) -> None:
        """A further geom of a body."""
        name = f"{self.bodies[body].name}.geom{len(self.geoms)}"
        self.geoms.append(Geom(name, body, shape, position, surface=surface, collides=collides))

    # ------------------------------------------------------------------ the result

    def world(self) -> World:
        """The frozen World."""
        starts = [*self._entities, ("", EntityKind.OBJECT, len(self.bodies), len(self.joints))]
        entities = tuple(
            Entity(name, kind, body, after[2], joint, after[3], label=name)
            for (name, kind, body, joint), after in pairwise(starts)
        )
        return World(
            self.name,
            self.physics,
            tuple(self.bodies),
            tuple(self.joints),
            tuple(self.geoms),
            tuple(self.sites),
            tuple(self.actuators),
            tuple(self.cameras),
            contact_sensors=tuple(self.sensors),
            entities=entities,
            robots=tuple(self._robot(e) for e in entities if e.kind is EntityKind.ROBOT),
            **self.more,
        )

    def _robot(self, entity: Entity) -> Robot:
        drives = [i for i, a in enumerate(self.actuators) if entity.joint_start <= a.joint < entity.joint_stop]
        arm = Channel("arm", tuple(self.actuators[i].joint for i in drives), tuple(drives))
        tools = {
            site.name.rpartition(".")[2]: i
            for i, site in enumerate(self.sites)
            if entity.body_start <= site.body < entity.body_stop
        }
        return Robot(entity.name, "sketch", {"arm": arm} if drives else {}, tools)
