"""The parts of a World: bodies, joints, geoms and what is fixed to them, and which of them belong together."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from math import inf
from types import MappingProxyType
from typing import Any, NamedTuple

from anysim.conventions import IDENTITY_QUATERNION, WORLD
from anysim.model.affordances import Affordance
from anysim.model.shapes import HASHED_IF_GIVEN as HASHED_IF_GIVEN, ORDINARY, Compliance, Shape, Surface, Vec3
from anysim_schemas.bounds import DEFAULT_EXTENT
from anysim_schemas.robot_model import RobotModelSpec

Quat = tuple[float, float, float, float]
ORIGIN: Vec3 = (0.0, 0.0, 0.0)


FAR = 1e6
"""[rad] or [m] A limit of a joint that is further out is none: engines each have a number of their own for that."""

NEVER_HASHED = MappingProxyType({"hashed": "never"})
"""Marks a field that shapes nothing that happens."""


class BodyKind(StrEnum):
    """How a body may move."""

    FREE = "free"
    STATIC = "static"
    LINK = "link"


class JointType(StrEnum):
    """What one degree of freedom does."""

    REVOLUTE = "revolute"  # also continuous ones: limits are infinite
    PRISMATIC = "prismatic"


class ControlMode(StrEnum):
    """Which terms of the drive law act."""

    POSITION = "position"  # u = kp (q* - q) + kd (qd* - qd) + ff
    VELOCITY = "velocity"  # u = kd (qd* - qd) + ff
    EFFORT = "effort"  # u = ff


class Actuation(StrEnum):
    """The computation of the drive law: by anysim or by the engine, and how it takes its damping."""

    IMPLICIT_PD = "implicit_pd"  # the law, its damping at the end of the step; the same on every engine
    EXPLICIT_PD = "explicit_pd"  # the law of the state at the beginning of the step; the same on every engine
    NATIVE = "native"  # the engine's own drives


class Inertial(NamedTuple):
    """Mass [kg], centre of mass [m] in the body frame, and the inertia about it in body axes.

    `inertia` is (ixx, iyy, izz, ixy, ixz, iyz) [kg m^2].
    """

    mass: float
    com: Vec3 = ORIGIN
    inertia: tuple[float, float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Solver(NamedTuple):
    """Settings of the contact solver for one entity; None leaves one to the engine. See `anysim_schemas.matter`."""

    position_iterations: int | None = None
    velocity_iterations: int | None = None
    sleep_threshold: float | None = None
    depenetration_speed: float | None = None


@dataclass(frozen=True, slots=True)
class Body:
    """A rigid body. `position`, `quaternion`: its frame in the parent's (or the world's) at zero joint position.

    `damping` are the rates [1/s] at which a free body without links loses linear and angular speed by itself: they
    fall as exp(-rate t). `solver` stands on the root of an entity.
    """

    name: str
    kind: BodyKind
    parent: int = WORLD
    position: Vec3 = ORIGIN
    quaternion: Quat = IDENTITY_QUATERNION
    inertial: Inertial = Inertial(0.0)
    gravity_compensation: bool = False
    damping: tuple[float, float] = (0.0, 0.0)
    solver: Solver | None = None
    virtual: bool = field(default=False, metadata=NEVER_HASHED)
    """Whether it is there for one of several joints of the body it carries, of whose mass it has a share."""


class Mimic(NamedTuple):
    """This joint follows another: position = offset + multiplier * leader + curve[0] * leader^2 + curve[1] * leader^3.

    `curve` goes on so, and is empty where the two are in proportion, which is what most engines can hold.
    """

    joint: int
    multiplier: float = 1.0
    offset: float = 0.0
    curve: tuple[float, ...] = ()

    def position(self, leader: Any) -> Any:
        """Where this joint is for a position of its leader, a number or an array."""
        return self.offset + self.multiplier * leader + sum(c * leader ** (k + 2) for k, c in enumerate(self.curve))

    def rate(self, leader: Any) -> Any:
        """How fast this joint moves for each unit of its leader's velocity, there."""
        return self.multiplier + sum((k + 2) * c * leader ** (k + 1) for k, c in enumerate(self.curve))


@dataclass(frozen=True, slots=True)
class Joint:
    """One degree of freedom that moves `body` against its parent, about or along `axis` through `anchor`.

    Units are [rad] or [m]; `axis` (unit) and `anchor` are in the body's frame; `friction` is dry friction [N m] or [N],
    `armature` the rotor's inertia at the joint. `initial` is the position after a reset. A spring pulls with
    `stiffness` [N m/rad] or [N/m] times the way to `spring_rest`, beside the drive and its limit.
    """

    name: str
    body: int
    type: JointType
    axis: Vec3
    anchor: Vec3 = ORIGIN
    lower: float = -inf
    upper: float = inf
    velocity_limit: float = inf
    effort_limit: float = inf
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    initial: float = 0.0
    mimic: Mimic | None = None
    limit_softness: float = 0.0  # time constant [s] of the limit and mimic constraints; 0 leaves it to the engine
    stiffness: float = field(default=0.0, metadata=HASHED_IF_GIVEN)
    spring_rest: float = field(default=0.0, metadata=HASHED_IF_GIVEN)
    limit_compliance: Compliance | None = field(default=None, metadata=HASHED_IF_GIVEN)
    friction_compliance: Compliance | None = field(default=None, metadata=HASHED_IF_GIVEN)
    mimic_compliance: Compliance | None = field(default=None, metadata=HASHED_IF_GIVEN)


@dataclass(frozen=True, slots=True)
class Geom:
    """A shape fixed to a body (or to the world: body -1).

    `texture` and `material` are names in the World's lists, empty for none; a texture is tinted with `color`.
    """

    name: str
    body: int
    shape: Shape
    position: Vec3 = ORIGIN
    quaternion: Quat = IDENTITY_QUATERNION
    color: tuple[float, float, float, float] = (0.7, 0.7, 0.7, 1.0)
    surface: Surface = ORDINARY
    collides: bool = True
    visible: bool = True
    texture: str = ""
    material: str = ""
    part_com: Vec3 | None = field(default=None, metadata=NEVER_HASHED)
    """[m] The centre of mass, in the body's frame, of the rigid part that it is on in its source, where the body has
    several. An engine that estimates how heavy a body is where it touches may be told to go by it."""


@dataclass(frozen=True, slots=True)
class Site:
    """A named frame fixed to a body (or to the world: body -1): a tool, a lumped link, a hole."""

    name: str
    body: int
    position: Vec3 = ORIGIN
    quaternion: Quat = IDENTITY_QUATERNION


@dataclass(frozen=True, slots=True)
class Actuator:
    """The drive of one joint; the law is u = kp (q* - q) + kd (qd* - qd) + ff, clipped to +-effort_limit.

    A drive that pulls at a tendon has `shares`, further joints and their coefficients: q is then the position of
    `joint` plus these times theirs, and u acts on them times the same.
    """

    name: str
    joint: int
    mode: ControlMode
    kp: float
    kd: float
    effort_limit: float = inf
    shares: tuple[tuple[int, float], ...] = field(default=(), metadata=HASHED_IF_GIVEN)


@dataclass(frozen=True, slots=True)
class Camera:
    """A pinhole camera, optical frame (x right, y down, z forward), fixed to a body or (-1) to the world."""

    name: str
    body: int
    position: Vec3
    quaternion: Quat
    fov: float  # vertical [degrees]
    width: int
    height: int
    channels: tuple[str, ...] = ("rgb",)
    look_at: str | None = None  # entity looked at from reset on
    near: float = 0.01
    far: float = 20.0


@dataclass(frozen=True, slots=True)
class Light:
    """A directional light, or a point light where it has a position."""

    name: str
    direction: Vec3
    position: Vec3 | None = None
    color: Vec3 = (1.0, 1.0, 1.0)
    intensity: float = 0.8


@dataclass(frozen=True, slots=True)
class Scenery:
    """What is around the things: colours in [0, 1], red green blue. None leaves it to the engine."""

    background: Vec3 | None = None
    ambient: Vec3 | None = None
    shadows: bool | None = None


@dataclass(frozen=True, slots=True)
class ContactSensor:
    """Net contact force [N] on the bodies, world axes; `against` restricts it to contacts with those bodies.

    A body index of -1 in `against` stands for geoms fixed to the world.
    """

    name: str
    bodies: tuple[int, ...]
    against: tuple[int, ...] | None = None


class EntityKind(StrEnum):
    """What an entity is."""

    ROBOT = "robot"
    OBJECT = "object"


@dataclass(frozen=True, slots=True)
class Entity:
    """A contiguous slice of bodies and joints, made from one source. Bodies [body_start, body_stop), joints alike.

    Its segmentation id is its position in `World.entities` plus one (0 is background and ground). It stands for the
    `instance`-th of a `category`, which is the name that it was declared by. A `rigid_instancer` has as many root
    bodies as instances, all others have one, the first.
    """

    name: str
    kind: EntityKind
    body_start: int
    body_stop: int
    joint_start: int
    joint_stop: int
    label: str = ""
    source: str = ""
    license: str = ""
    category: str = ""
    instance: int = 0
    family: str = "rigid"
    affordances: tuple[Affordance, ...] = field(default=(), metadata=NEVER_HASHED)
    """Where it is taken hold of, in local names. No engine reads them: they shape nothing that happens by itself."""

    @property
    def root(self) -> int:
        """The index of the root body."""
        return self.body_start


@dataclass(frozen=True, slots=True)
class Slot:
    """A logical object, the same in every episode and on every engine: the `instance`-th of a `category`.

    `entities` are the indices of the entities that it can be, each with its own asset; in an env at most one of
    them is present at a time, nominally the first, or none where `initially` is not set. Most slots have one, of the
    same name.
    """

    name: str
    category: str
    instance: int
    entities: tuple[int, ...]
    initially: bool = True


@dataclass(frozen=True, slots=True)
class Tile:
    """A piece of tiled ground: its level of difficulty (`row`), its kind (`column`), and where a scene stands on it.

    `origin` [m] is on the tile's platform, relative to that of the first tile, which is the world's origin.
    """

    row: int
    column: int
    kind: str
    difficulty: float
    origin: Vec3


@dataclass(frozen=True, slots=True)
class Channel:
    """Joints of a robot that are commanded together: indices into the world's joints and actuators.

    `opened` and `closed` are the joint targets of a gripper.
    """

    name: str
    joints: tuple[int, ...]
    actuators: tuple[int, ...]
    opened: tuple[float, ...] | None = None
    closed: tuple[float, ...] | None = None


@dataclass(frozen=True, slots=True)
class Robot:
    """What a robot exposes beyond its entity: channels, and tools (name: site index)."""

    name: str
    model: str
    channels: Mapping[str, Channel]
    tools: Mapping[str, int]
    entry: RobotModelSpec | None = field(default=None, compare=False, metadata=NEVER_HASHED)
    """Its entry in the catalogue, for controllers; None for one that is in none. What it says of physics is above."""


@dataclass(frozen=True, slots=True)
class Physics:
    """Time steps [s], gravity [m/s^2], what an engine may choose about friction, and how drives act.

    With `velocity_limits` a drive asks for no more than its joint's velocity limit; see `docs/conventions.md`.
    """

    dt: float = 0.002
    control_dt: float = 0.02
    gravity: Vec3 = (0.0, 0.0, -9.81)
    friction_cone: str = "elliptic"
    impratio: float = 1.0
    actuation: Actuation = Actuation.IMPLICIT_PD
    velocity_limits: bool = False
    extent: float = field(default=DEFAULT_EXTENT, metadata=HASHED_IF_GIVEN)
    """Distance from the origin along an axis [m] beyond which a body has left the world."""

    @property
    def substeps(self) -> int:
        """Physics steps per control step."""
        return round(self.control_dt / self.dt)
