"""Neutral surfaces and constraints as MuJoCo's solref and solimp.

MuJoCo blends the parameters of two geoms by their `solmix` weights; a bouncy geom gets so large a weight that it
decides the pair, and the bouncier of two outweighs the other, which is the pair rule of `anysim.conventions`.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import atan2, exp, log, pi, sqrt
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.model.world import Compliance, Surface

STIFF_IMPEDANCE = (0.99, 0.999, 0.001, 0.5, 2.0)
"""Impedance of joint limits and mimic couplings: they give way by next to nothing."""

DRY_IMPEDANCE = (0.9999, 0.9999, 0.001, 0.5, 2.0)
"""Impedance of dry friction, MuJoCo's largest: under 95 % of 5 N m a joint of 0.1 kg m^2 creeps by 1e-5 rad/s."""

NATIVE_REFERENCE, NATIVE_IMPEDANCE = 0.02, (0.9, 0.95, 0.001, 0.5, 2.0)
"""MuJoCo's own time constant [s] and impedance of all constraints."""

BOUNCE_FREQUENCY = 0.3
"""Natural frequency of a bouncy contact [rad per time step]. A bounce takes ten steps and sinks 6 mm per m/s at 2 ms; a
higher frequency sinks less and gives the coefficient back less exactly, since the impact falls between two steps."""


@dataclass(frozen=True, slots=True)
class ContactParameters:
    """The fields of a MuJoCo geom that say how it touches."""

    friction: tuple[float, float, float]
    condim: int
    priority: int
    solref: tuple[float, float]
    solimp: tuple[float, float, float, float, float]
    solmix: float
    margin: float
    """[m] from which on forces act; things come to rest off each other by it."""
    gap: float
    """[m] off the margin from which on contacts are found."""


def contact_parameters(surface: Surface, dt: float) -> ContactParameters:
    """MuJoCo's contact parameters of a surface, for a time step `dt` [s]."""
    own = surface.compliance or Compliance()
    low, high = surface.impedance
    solref, solmix = own.reference or (surface.softness or NATIVE_REFERENCE, 1.0), own.weight
    if surface.restitution > 0:
        ratio = damping_ratio(surface.restitution)
        solref, solmix = (dt / (BOUNCE_FREQUENCY * ratio), ratio), 10.0 ** (20 + 100 * surface.restitution)
    return ContactParameters(
        friction=(surface.friction, surface.torsional_friction, surface.rolling_friction),
        condim=own.dimensions or (4 if surface.torsional else 3),
        priority=surface.priority,
        solref=solref,
        solimp=own.impedance or (low, high, 0.001, 0.5, 2.0),
        solmix=solmix,
        margin=own.margin,
        gap=own.gap if surface.contact_offset is None else surface.contact_offset,
    )


def restitution_of(solmix: Array) -> Array:
    """The coefficients that surfaces with these weights were given; see `contact_parameters`."""
    return np.where(solmix > 1e19, (np.log10(np.maximum(solmix, 1.0)) - 20.0) / 100.0, 0.0)


class ConstraintFields(NamedTuple):
    """MuJoCo's fields of a limit, a tie or dry friction."""

    solref: tuple[float, float]
    solimp: tuple[float, float, float, float, float]
    margin: float


class Stiffness(NamedTuple):
    """How hard constraints are, for a time step `dt` [s]; `native`: as MuJoCo has those of which nothing was said."""

    dt: float
    native: bool

    def fields(
        self, given: Compliance | None, softness: float = 0.0, impedance: tuple[float, ...] = STIFF_IMPEDANCE
    ) -> ConstraintFields:
        """Of a constraint: as its source says, else by its time constant [s], else as stiff as the step allows."""
        own = given or Compliance()
        constant = softness or (NATIVE_REFERENCE if self.native else 0.004)
        a, b, c, d, e = own.impedance or (NATIVE_IMPEDANCE if self.native else impedance)
        return ConstraintFields(own.reference or (max(constant, 2 * self.dt), 1.0), (a, b, c, d, e), own.margin)


def rebound(ratio: float) -> float:
    """Restitution of a damped spring that can push and not pull, by its damping ratio (Schwager & Pöschel 2007).

    The contact ends when its force vanishes, before the spring is back at its rest length. With s = sqrt|1 - ratio^2|:
    e = exp(-ratio/s * (pi - atan2(2 ratio s, 1 - 2 ratio^2))) below a ratio of 1, and
    e = exp(-ratio/s * log((ratio + s) / (ratio - s))) above.
    """
    if abs(ratio - 1) < 1e-9:
        return exp(-2.0)
    s = sqrt(abs(1 - ratio * ratio))
    span = log((ratio + s) / (ratio - s)) if ratio > 1 else pi - atan2(2 * ratio * s, 1 - 2 * ratio * ratio)
    return exp(-ratio / s * span)


@lru_cache(maxsize=4096)
def damping_ratio(restitution: float) -> float:
    """The damping ratio with which a contact gives back `restitution` of the approach speed."""
    low, high = 1e-4, 1e4
    for _ in range(200):
        middle = sqrt(low * high)
        low, high = (middle, high) if rebound(middle) > restitution else (low, middle)
    return high
