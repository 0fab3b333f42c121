"""A base with two driven wheels and castors."""

from anysim.assets.model import ImportedModel
from anysim_assets.assembly import Assembly
from anysim_assets.parameters import Size
from anysim_assets.wheels import Wheel, add_body, add_castor, add_wheel, check_bottom, made
from anysim_schemas.base import Color, Number, Positive
from anysim_schemas.errors import KeyFault


def differential_base(
    *,
    size: Size = (0.52, 0.36, 0.20),
    mass: Positive = 30.0,
    clearance: Positive = 0.06,
    wheel_radius: Positive = 0.1,
    wheel_width: Positive = 0.04,
    track: Positive = 0.42,
    castors: tuple[tuple[Number, Number], ...] = ((0.21, 0.0), (-0.21, 0.0)),
    castor_radius: Positive = 0.03,
    wheel_speed: Positive = 15.0,
    wheel_torque: Positive = 20.0,
    color: Color = (0.86, 0.87, 0.88),
    wheel_color: Color = (0.12, 0.12, 0.13),
) -> ImportedModel:
    """A base with two driven wheels on one axle, and balls as castors that carry the rest without friction.

    Its frame `base` is in the middle of the axle, `wheel_radius` above the ground, x forward. Joints: `left_wheel` and
    `right_wheel`, positive forward. Frame: `top`, the middle of the body's top, where an arm is put.

    Args:
        size: length, width and height of the body [m].
        mass: of the body [kg]; wheels and castors have theirs.
        clearance: between the body and the ground [m].
        wheel_radius: [m].
        wheel_width: [m].
        track: distance of the middles of the wheels [m].
        castors: x, y of each ball [m].
        castor_radius: of the balls [m].
        wheel_speed: largest speed of a wheel [rad/s].
        wheel_torque: largest torque of a wheel's drive [N m].
        color: of the body.
        wheel_color: of wheels and castors.

    Raises:
        KeyFault: the parts do not fit.
    """
    bottom = check_bottom(size, clearance, wheel_radius)
    if track - wheel_width < size[1]:
        raise KeyFault(f"wheels {track:g} m apart reach into a body {size[1]:g} m wide", "track")
    if not castors:
        raise KeyFault("two wheels alone do not stand; give at least one castor", "castors")
    if castor_radius * 2 > clearance + size[2]:
        raise KeyFault(f"balls of {castor_radius:g} m reach through the body", "castor_radius")
    base = Assembly("differential_base")
    add_body(base, size, bottom, 0.0, mass, color)
    for i, (x, y) in enumerate(castors):
        add_castor(base, f"castor_{i + 1}", x, y, castor_radius, -wheel_radius, wheel_color)
    wheel = Wheel(wheel_radius, wheel_width, wheel_speed, wheel_torque, wheel_color)
    for name, y in (("left_wheel", track / 2), ("right_wheel", -track / 2)):
        add_wheel(base, name, (0.0, y, 0.0), wheel)
    return made(base)
