"""A camera that flies: a chain of six joints without weight or contact, so that any controller of joints moves it."""

from math import inf, pi

from anysim.assets.model import ImportedModel
from anysim.model.appearance import rgb
from anysim.model.world import Body, BodyKind, Box, Geom, Inertial, Joint, JointType, Site, Sphere
from anysim_schemas.base import Color, Flag, NonNegative, Positive

_AXES = {
    "x": (JointType.PRISMATIC, (1.0, 0.0, 0.0)), "y": (JointType.PRISMATIC, (0.0, 1.0, 0.0)),
    "z": (JointType.PRISMATIC, (0.0, 0.0, 1.0)), "yaw": (JointType.REVOLUTE, (0.0, 0.0, 1.0)),
    "pitch": (JointType.REVOLUTE, (0.0, 1.0, 0.0)), "roll": (JointType.REVOLUTE, (1.0, 0.0, 0.0)),
}  # fmt: skip


def camera_body(
    *,
    reach: Positive = 20.0,
    mass: Positive = 0.2,
    inertia: Positive = 0.002,
    speed: Positive = 10.0,
    rate: Positive = 10.0,
    force: Positive = 200.0,
    torque: Positive = 20.0,
    over: Flag = False,
    hull: NonNegative = 0.0,
    visible: bool = True,
    color: Color = (0.15, 0.15, 0.17),
) -> ImportedModel:
    """A body that moves along x, y, z and turns by yaw, pitch and roll, in this order; only a hull touches things.

    At zero it is where it stands and looks along x, level; positive pitch looks down. The frame `lens` is where it
    looks from, x forward; the box behind it shows where it is.

    Args:
        reach: how far it goes to each side of where it stands [m].
        mass: of each link of the chain [kg].
        inertia: of each link about any axis [kg m^2].
        speed, rate: largest along and about an axis [m/s], [rad/s].
        force, torque: of the drives along and about an axis [N], [N m].
        over: whether it pitches past straight up and down, without end.
        hull: radius [m] of a ball about the lens that touches things; 0 for none.
        visible: whether the box is seen by other cameras.
        color: of the box.
    """
    bodies, joints = [Body("base", BodyKind.STATIC)], []
    link = Inertial(mass, inertia=(inertia, inertia, inertia, 0.0, 0.0, 0.0))
    for number, (name, (kind, axis)) in enumerate(_AXES.items()):
        slides = kind is JointType.PRISMATIC
        # upside down is no useful view, and straight up or down has no heading
        most = reach if slides else {"yaw": inf, "pitch": inf if over else pi / 2, "roll": pi}[name]
        bodies.append(Body(f"{name}_link", BodyKind.LINK, number, inertial=link))
        joints.append(
            Joint(
                name,
                number + 1,
                kind,
                axis,
                lower=-most,
                upper=most,
                velocity_limit=speed if slides else rate,
                effort_limit=force if slides else torque,
            )
        )
    last = len(bodies) - 1
    shown = Geom(
        "roll_link.box", last, Box((0.05, 0.04, 0.03)), (-0.06, 0.0, 0.0), color=(*rgb(color), 1.0), collides=False
    )
    felt = Geom("roll_link.hull", last, Sphere(hull), visible=False)
    return ImportedModel(
        "camera_body",
        tuple(bodies),
        tuple(joints),
        ((shown,) if visible else ()) + ((felt,) if hull else ()),
        ("roll_link",) if visible else (),
        (Site("lens", last),),
        links={body.name: i for i, body in enumerate(bodies)},
    )
