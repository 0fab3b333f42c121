"""Worlds of the contract suite in which not everything is there in every env, and what is left of them."""

from dataclasses import replace

import numpy as np

from anysim.compile.edit import without_entity
from anysim.conventions import WORLD, Array
from anysim.engine.capability import Capabilities
from anysim.engine.requirements import needs_of
from anysim.math import pose as P
from anysim.model.world import (
    Box,
    Camera,
    ContactSensor,
    ControlMode,
    EntityKind,
    JointType,
    Mimic,
    Slot,
    Sphere,
    Vec3,
    World,
)
from anysim.testing.sketch import Sketch, inertial

CHOICES = {"mug": ("mug~0", "mug~1", "mug~2"), "chest": ("chest~0", "chest~1"), "post": ("post",), "lid": ("lid",)}
"""Slots of `varied` and the entities that each can be."""

FULL = ("mug~1", "chest~0", "post", "lid")
BARE: tuple[str, ...] = ()
"""Two choices of `varied`: something of each slot, and nothing of any."""

EYE: Vec3 = (0.0, -2.2, 0.9)


def varied(capabilities: Capabilities, cameras: bool = False) -> World:
    """A driven arm, a table and a box on it that are always there, and four slots.

    `mug` stands on the table: a ball, a block, or a free body with a swinging handle; what it can be lies in one place.
    `chest` is a cabinet with a drawer and a lid that follows it, or a fixed crate. `post` is fixed, `lid` lies on the
    box. An engine without joints or contacts gets the free and fixed ones alone.
    """
    whole = _varied(cameras, articulated=True)
    return whole if all(n.capability in capabilities for n in needs_of(whole)) else _varied(cameras, articulated=False)


def _varied(cameras: bool, articulated: bool) -> World:
    s = Sketch("varied")
    touch = articulated
    objects: list[str] = []
    if touch:
        s.ground()
        _arm(s)
    s.fixed("table", Box((0.4, 0.4, 0.05)), (0.0, 0.0, 0.05), collides=touch)
    box = s.free("box", Box((0.06, 0.06, 0.06)), (0.2, 0.1, 0.16), 0.8, collides=touch)
    ball = s.free("mug~0", Sphere(0.05), (-0.1, 0.0, 0.152), 0.3, collides=touch)
    s.free("mug~1", Box((0.05, 0.04, 0.06)), (-0.1, 0.0, 0.162), 0.4, collides=touch)
    if touch:
        objects += _swinging(s, "mug~2", (-0.1, 0.0, 0.152))
        objects += _cabinet(s, "chest~0", (0.0, 0.6, 0.2))
    else:
        s.free("mug~2", Sphere(0.02), (-0.1, 0.0, 0.152), collides=False)
        s.fixed("chest~0", Box((0.2, 0.02, 0.2)), (0.0, 0.6, 0.2), collides=False)
    s.fixed("chest~1", Box((0.15, 0.15, 0.15)), (0.0, 0.6, 0.15), collides=touch)
    s.fixed("post", Box((0.03, 0.03, 0.3)), (-0.25, 0.15, 0.4), collides=touch)
    s.free("lid", Box((0.05, 0.05, 0.01)), (0.2, 0.1, 0.2302), 0.1, collides=touch)
    if touch:
        s.sensors += [ContactSensor("box", (box,)), ContactSensor("mug", (ball,))]
    if cameras:
        turn = tuple(float(v) for v in P.look_at(np.array(EYE), np.array([0.0, 0.1, 0.2])))
        channels = ("rgb", "depth", "segmentation")
        s.cameras.append(Camera("front", WORLD, EYE, turn, 40.0, 96, 72, channels))  # pyright: ignore[reportArgumentType]
    made = s.world()
    # a sketch makes robots of whatever has links
    entities = tuple(replace(e, kind=EntityKind.OBJECT) if e.name in objects else e for e in made.entities)
    robots = tuple(robot for robot in made.robots if robot.name not in objects)
    return with_slots(replace(made, entities=entities, robots=robots), CHOICES)


def _arm(s: Sketch) -> None:
    """A driven link that reaches over the table and touches nothing."""
    rod = Box((0.12, 0.02, 0.02))
    base = s.robot("arm", (-0.45, 0.0, 0.5))
    link = s.link("swing", base, JointType.REVOLUTE, (0.0, 0.0, 1.0), inertial(rod, 1.0, (0.12, 0.0, 0.0)), damping=0.1)
    s.shape(link, rod, (0.12, 0.0, 0.0))
    s.drive(link, ControlMode.POSITION, 60.0, 6.0, 40.0)


def _swinging(s: Sketch, name: str, position: Vec3) -> list[str]:
    """A free cube with a handle that swings about its own weight."""
    cube, bar = Box((0.05, 0.05, 0.05)), Box((0.005, 0.03, 0.005))
    root = s.free(name, cube, position, 0.5)
    link = s.link(
        "handle",
        root,
        JointType.REVOLUTE,
        (1.0, 0.0, 0.0),
        inertial(bar, 0.05, (0.0, 0.03, 0.0)),
        position=(0.0, 0.055, 0.02),
        damping=0.01,
        initial=0.4,
    )
    s.shape(link, bar, (0.0, 0.03, 0.0))
    return [name]


def _cabinet(s: Sketch, name: str, position: Vec3) -> list[str]:
    """A fixed frame with a drawer that dry friction holds, and a flap that follows the drawer."""
    base = s.robot(name, position)
    s.shape(base, Box((0.2, 0.02, 0.2)), (0.0, 0.15, 0.0))
    tray, flap = Box((0.12, 0.12, 0.04)), Box((0.1, 0.005, 0.05))
    drawer = s.link(
        "drawer",
        base,
        JointType.PRISMATIC,
        (0.0, -1.0, 0.0),
        inertial(tray, 1.0),
        lower=0.0,
        upper=0.2,
        friction=1.0,
        damping=1.0,
        initial=0.05,
    )
    s.shape(drawer, tray)
    follower = s.link(
        "flap",
        base,
        JointType.PRISMATIC,
        (0.0, 0.0, 1.0),
        inertial(flap, 0.2),
        position=(0.0, 0.15, 0.3),
        mimic=Mimic(len(s.joints) - 1, 0.5, 0.01),
        initial=0.035,
    )
    s.shape(follower, flap)
    return [name]


def with_slots(world: World, choices: dict[str, tuple[str, ...]]) -> World:
    """The same world, in which these entities may be absent, at most one of each slot's present."""
    number = {entity.name: i for i, entity in enumerate(world.entities)}
    slots = [Slot(name, name, 0, tuple(number[e] for e in entities)) for name, entities in choices.items()]
    return replace(world, slots=tuple(slots))


def having(world: World, *names: str) -> Array:
    """(1, entities) bool: what is in no slot, and of the others these."""
    varying = {entity for slot in world.slots for entity in slot.entities}
    row = [index not in varying or entity.name in names for index, entity in enumerate(world.entities)]
    assert set(names) <= {entity.name for entity in world.entities}
    return np.array([row])


def random_presence(world: World, rng: np.random.Generator, rows: int) -> Array:
    """(rows, entities) bool: of each slot one of what it can be, or nothing."""
    present = np.zeros((rows, len(world.entities)), dtype=bool)
    present[:] = having(world)
    for slot in world.slots:
        chosen = rng.integers(-1, len(slot.entities), size=rows)
        for row, choice in enumerate(chosen.tolist()):
            if choice >= 0:
                present[row, slot.entities[choice]] = True
    return present


def reduced(world: World, *names: str) -> World:
    """A world in which nothing varies: of what may be absent only these are in it, always."""
    varying = [world.entities[entity].name for slot in world.slots for entity in slot.entities]
    less = replace(world, slots=())
    for name in varying:
        if name not in names:
            less = without_entity(less, name)
    return less


def shared_bodies(world: World, less: World) -> tuple[Array, Array]:
    """Indices (world, less) of the bodies that are in both."""
    place = {body.name: i for i, body in enumerate(world.bodies)}
    return np.array([place[body.name] for body in less.bodies]), np.arange(len(less.bodies))
