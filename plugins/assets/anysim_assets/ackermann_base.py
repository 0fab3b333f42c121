"""A car: two driven wheels at the back, two steered ones at the front."""

from typing import Annotated

from pydantic import Field

from anysim.assets.model import ImportedModel
from anysim.model.world import Sphere
from anysim_assets.assembly import Assembly
from anysim_assets.parameters import Size
from anysim_assets.wheels import RUBBER, Wheel, add_body, add_steering, add_wheel, check_bottom, made
from anysim_schemas.base import Color, Positive
from anysim_schemas.errors import KeyFault

_KNUCKLE = 0.02  # [m] radius of the ball that stands for what turns with a steered wheel


def ackermann_base(
    *,
    size: Size = (0.72, 0.30, 0.16),
    mass: Positive = 30.0,
    clearance: Positive = 0.07,
    wheel_radius: Positive = 0.1,
    wheel_width: Positive = 0.05,
    track: Positive = 0.40,
    wheelbase: Positive = 0.5,
    steering_limit: Annotated[Positive, Field(lt=1.5)] = 0.8,
    wheel_speed: Positive = 30.0,
    wheel_torque: Positive = 20.0,
    steering_speed: Positive = 6.0,
    steering_torque: Positive = 20.0,
    color: Color = (0.75, 0.16, 0.12),
    wheel_color: Color = (0.12, 0.12, 0.13),
) -> ImportedModel:
    """A car whose rear wheels are driven and whose front wheels are steered, each by a joint of its own.

    Its frame `base` is in the middle of the rear axle, `wheel_radius` above the ground, x forward. Joints: `rear_left`,
    `rear_right`, `front_left`, `front_right` turn the wheels, positive forward; `steer_left` and `steer_right` steer,
    positive to the left, about axes through the middles of the front wheels. Frame: `top` on the body.

    Args:
        size: length, width and height of the body [m].
        mass: of the body [kg]; wheels have theirs.
        clearance: between the body and the ground [m].
        wheel_radius: [m].
        wheel_width: [m].
        track: distance of the middles of left and right wheels [m].
        wheelbase: distance of the axles [m].
        steering_limit: how far a wheel turns to either side [rad].
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
    if track - wheel_width < size[1]:
        raise KeyFault(f"wheels {track:g} m apart reach into a body {size[1]:g} m wide", "track")
    if wheelbase <= 2 * wheel_radius:
        raise KeyFault(f"axles {wheelbase:g} m apart leave wheels of {wheel_radius:g} m in each other", "wheelbase")
    base = Assembly("ackermann_base")
    add_body(base, size, bottom, wheelbase / 2, mass, color)
    wheel = Wheel(wheel_radius, wheel_width, wheel_speed, wheel_torque, wheel_color)
    sides = {"left": track / 2, "right": -track / 2}
    for side, y in sides.items():
        add_wheel(base, f"rear_{side}", (0.0, y, 0.0), wheel)
    for side, y in sides.items():
        place, limit = (wheelbase, y, 0.0), steering_limit
        knuckle = add_steering(base, f"steer_{side}", place, speed=steering_speed, torque=steering_torque, limit=limit)
        base.solid(knuckle, "knuckle", Sphere(_KNUCKLE), (0.0, 0.0, 0.0), 8 * RUBBER, wheel_color, collides=False)
        add_wheel(base, f"front_{side}", (0.0, 0.0, 0.0), wheel, parent=knuckle)
    return made(base)
