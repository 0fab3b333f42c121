"""A base on four wheels that are each steered and driven."""

from anysim.assets.model import ImportedModel
from anysim.model.world import Cylinder
from anysim_assets.assembly import Assembly
from anysim_assets.parameters import Size
from anysim_assets.wheels import RUBBER, Wheel, add_body, add_steering, add_wheel, check_bottom, made
from anysim_schemas.base import Color, Positive
from anysim_schemas.errors import KeyFault

CORNERS = {"front_left": (1, 1), "front_right": (1, -1), "rear_left": (-1, 1), "rear_right": (-1, -1)}


def holonomic_base(
    *,
    size: Size = (0.60, 0.50, 0.20),
    mass: Positive = 40.0,
    clearance: Positive = 0.17,
    wheel_radius: Positive = 0.08,
    wheel_width: Positive = 0.04,
    wheelbase: Positive = 0.44,
    track: Positive = 0.34,
    wheel_speed: Positive = 20.0,
    wheel_torque: Positive = 20.0,
    steering_speed: Positive = 15.0,
    steering_torque: Positive = 20.0,
    color: Color = (0.86, 0.87, 0.88),
    wheel_color: Color = (0.12, 0.12, 0.13),
) -> ImportedModel:
    """A base on four wheels, each steered about an axis through its middle and driven: it moves in any direction.

    Its frame `base` is amid the wheels, `wheel_radius` above the ground, x forward. Joints: `steer_front_left`,
    `steer_front_right`, `steer_rear_left`, `steer_rear_right`, positive to the left, and `wheel_front_left`, …,
    positive forward. Frame: `top`, the middle of the body's top, where an arm is put.

    Args:
        size: length, width and height of the body, which is above the wheels [m].
        mass: of the body [kg]; wheels have theirs.
        clearance: between the body and the ground [m].
        wheel_radius: [m].
        wheel_width: [m].
        wheelbase: distance of front and rear wheels [m].
        track: distance of left and right wheels [m].
        wheel_speed: largest speed of a wheel [rad/s].
        wheel_torque: largest torque of a wheel's drive [N m].
        steering_speed: [rad/s].
        steering_torque: [N m].
        color: of the body.
        wheel_color: of the wheels.

    Raises:
        KeyFault: the parts do not fit.
    """
    bottom = check_bottom(size, clearance, wheel_radius)
    if clearance <= 2 * wheel_radius:
        raise KeyFault(
            f"wheels of {wheel_radius:g} m that steer reach into a body {clearance:g} m above the ground", "clearance"
        )
    base = Assembly("holonomic_base")
    add_body(base, size, bottom, 0.0, mass, color)
    wheel = Wheel(wheel_radius, wheel_width, wheel_speed, wheel_torque, wheel_color)
    post = (bottom - wheel_width / 2) / 2
    shape, middle = Cylinder(wheel_width / 4, post), (0.0, 0.0, bottom - post)
    for corner, (x, y) in CORNERS.items():
        place = (x * wheelbase / 2, y * track / 2, 0.0)
        steer = add_steering(base, f"steer_{corner}", place, speed=steering_speed, torque=steering_torque)
        base.solid(steer, "post", shape, middle, RUBBER, wheel_color, collides=False)
        add_wheel(base, f"wheel_{corner}", (0.0, 0.0, 0.0), wheel, parent=steer)
    return made(base)
