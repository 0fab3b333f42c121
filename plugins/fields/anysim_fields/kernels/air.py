"""The mean flow of air: wind, a round turbulent jet, and the plume over a source of heat.

Jet: on its axis the speed falls as 6.06 diameters over the distance, once that is below one; it is half as fast 0.094
of the distance away from the axis (Hussein, Capp and George 1994, as Pope's Turbulent Flows has it). Plume: speed and
warmth on its axis are McCaffrey's (1979) for fires of 14 to 58 kW; half as fast 0.12 of the height away (Heskestad).
Both have the profile of a bell, and draw in as much air from the sides as they gain. Wind carries the axis of a plume
along while it rises; it does not bend a jet.
"""

import math

from anysim.conventions import Array
from anysim_fields.kernels.compiling import compiled
from anysim_fields.laws import DECAY, FLAME, JET_SPREAD, PLUME, PLUME_SPREAD, ROOM

LN2 = math.log(2.0)
BASE = 0.1
"""Radii over the source below which air comes in from the sides as it does there: nearer, a plume would draw in more
without end."""
STEP = 1e-4
"""Share of a distance by which slopes are taken."""


@compiled
def plume_speed(power: float, height: float) -> float:
    """[m/s] on the axis over `power` [W] at a height [m]."""
    if power <= 0.0 or height <= 0.0:
        return 0.0
    kilo = power / 1000.0
    z = height / kilo**0.4
    if z < FLAME:
        return 6.8 * math.sqrt(height)
    return 1.9 * kilo**0.2 if z < PLUME else 1.1 * (kilo / height) ** (1.0 / 3.0)


@compiled
def plume_warmth(power: float, height: float) -> float:
    """[K] on the axis, above the air around."""
    if power <= 0.0:
        return 0.0
    z = max(height, 1e-9) / (power / 1000.0) ** 0.4
    scale = 0.9 * math.sqrt(2.0 * 9.81)
    if z < FLAME:
        return (6.8 / scale) ** 2 * ROOM
    return (1.9 / scale) ** 2 / z * ROOM if z < PLUME else (1.1 / scale) ** 2 * z ** (-5.0 / 3.0) * ROOM


@compiled
def climb_time(power: float, height: float) -> float:
    """[s] that air on the axis takes to come up to a height [m]."""
    if power <= 0.0 or height <= 0.0:
        return 0.0
    kilo = power / 1000.0
    one, two = FLAME * kilo**0.4, PLUME * kilo**0.4
    found = 2.0 / 6.8 * math.sqrt(min(height, one))
    if height > one:
        found += (min(height, two) - one) / (1.9 * kilo**0.2)
    if height > two:
        found += 0.75 / (1.1 * kilo ** (1.0 / 3.0)) * (height ** (4.0 / 3.0) - two ** (4.0 / 3.0))
    return found


@compiled
def jet_speed(speed: float, radius: float, along: float) -> float:
    """[m/s] on the axis of a jet from a nozzle [m], so far along it."""
    return speed * min(1.0, DECAY * 2.0 * radius / max(along, 1e-9))


@compiled
def _flux(heat: float, speed: float, radius: float, along: float, off: float) -> float:
    """[m^3/s] over 2 pi that flows within a distance from the axis."""
    if along <= 0.0:
        return 0.0
    middle = plume_speed(heat, along) if heat > 0.0 else jet_speed(speed, radius, along)
    half = max(radius, (PLUME_SPREAD if heat > 0.0 else JET_SPREAD) * along)
    return middle * half * half / (2.0 * LN2) * (1.0 - math.exp(-LN2 * (off / half) ** 2))


@compiled
def _along_axis(heat: float, speed: float, radius: float, along: float, off: float) -> tuple[float, float, float]:
    """Speeds along and away from an axis [m/s], and the rate [1/s] at which what is carried widens."""
    if along <= 0.0:
        return 0.0, 0.0, 0.0
    spread = PLUME_SPREAD if heat > 0.0 else JET_SPREAD
    half = max(radius, spread * along)
    middle = plume_speed(heat, along) if heat > 0.0 else jet_speed(speed, radius, along)
    forward = middle * math.exp(-LN2 * (off / half) ** 2)
    base = max(along, BASE * radius)
    step, far = STEP * base, max(off, 1e-3 * half)
    slope = _flux(heat, speed, radius, base + step, far) - _flux(heat, speed, radius, base - step, far)
    outward = -slope / (2.0 * step) / far * (off / far)
    return forward, outward, forward * spread / half if half > radius else 0.0


@compiled
def air_velocity(
    place: Array, source: Array, axis: Array, wind: Array, heat: float, speed: float, radius: float, out: Array
) -> float:
    """Velocity of the air at a place, into `out` (3,) [m/s].

    Args:
        place: (3,) [m].
        source: (3,) [m].
        axis: (3,) unit vector of the jet.
        wind: (3,) [m/s].
        heat: [W] of the source.
        speed: [m/s] of the jet at the source.
        radius: [m] of the source.
        out: changed.

    Returns the rate [1/s] at which what is carried there widens.
    """
    for i in range(3):
        out[i] = wind[i]
    wider = 0.0
    if heat > 0.0:
        up = place[2] - source[2]
        late = climb_time(heat, up)
        x, y = place[0] - source[0] - late * wind[0], place[1] - source[1] - late * wind[1]
        off = math.sqrt(x * x + y * y)
        forward, outward, wider = _along_axis(heat, 0.0, radius, up, off)
        out[2] += forward
        if off > 0.0:
            out[0] += outward * x / off
            out[1] += outward * y / off
    if speed > 0.0:
        x, y, z = place[0] - source[0], place[1] - source[1], place[2] - source[2]
        along = x * axis[0] + y * axis[1] + z * axis[2]
        x, y, z = x - along * axis[0], y - along * axis[1], z - along * axis[2]
        off = math.sqrt(x * x + y * y + z * z)
        forward, outward, more = _along_axis(0.0, speed, radius, along, off)
        wider = max(wider, more)
        side = outward / off if off > 0.0 else 0.0
        out[0] += forward * axis[0] + side * x
        out[1] += forward * axis[1] + side * y
        out[2] += forward * axis[2] + side * z
    return wider
