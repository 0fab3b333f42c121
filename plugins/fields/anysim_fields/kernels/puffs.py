"""Puffs: clouds of the form of a bell that air carries, widens and shakes, one env after the other."""

import math

import numpy as np

from anysim.conventions import Array
from anysim_fields.kernels.air import air_velocity
from anysim_fields.kernels.compiling import compiled

GUST_TIME = 0.25
"""[s] in which a gust is forgotten."""
ONE = np.uint64(1)


@compiled
def uniform(seed: int, tick: int, what: int) -> float:
    """A number above 0 and at most 1 that depends on nothing but these (splitmix64)."""
    z = np.uint64(seed) + np.uint64(0x9E3779B97F4A7C15) * (np.uint64(tick) * np.uint64(1048576) + np.uint64(what) + ONE)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return (float(z >> np.uint64(11)) + 1.0) / 9007199254740992.0


@compiled
def normal(seed: int, tick: int, what: int) -> float:
    """A normal number, likewise."""
    first, second = uniform(seed, tick, 2 * what), uniform(seed, tick, 2 * what + 1)
    return math.sqrt(-2.0 * math.log(first)) * math.cos(2.0 * math.pi * second)


@compiled
def advance(
    x: Array,
    v: Array,
    gust: Array,
    size: Array,
    mass: Array,
    age: Array,
    place: Array,
    due: Array,
    luck: Array,
    source: Array,
    axis: Array,
    wind: Array,
    heat: float,
    speed: float,
    radius: float,
    turbulence: float,
    diffusion: float,
    settling: float,
    ground: float,
    begun: float,
    rate: float,
    duration: float,
) -> None:
    """Move the puffs of an env on, and let new ones out.

    Args:
        x, v, gust: (K, 3) [m], [m/s], and in standard deviations.
        size: (K,) [m] the standard deviation of each bell.
        mass: (K,) [kg].
        age: (K,) [s]; below 0 where there is none.
        place: (1,) int64 the next place in the arrays.
        due: (1,) int64 billionths of a puff.
        luck: (2,) int64 a seed and a counter of steps.
        source, axis, wind, heat, speed, radius: as `air_velocity` has them.
        turbulence: share of the speed of the jet or the plume there that gusts have in each direction.
        diffusion: [m^2/s] of the air around.
        settling: [m/s] downward.
        ground: [m] height that they do not pass.
        begun: [kg] of a new puff.
        rate: [1/s] of new puffs; 0 where there are none.
        duration: [s].
    """
    count = x.shape[0]
    seed, tick = luck[0], luck[1]
    stay = math.exp(-duration / GUST_TIME)
    shake = math.sqrt(1.0 - stay * stay)
    for k in range(count):
        if age[k] < 0.0:
            continue
        wider = air_velocity(x[k], source, axis, wind, heat, speed, radius, v[k])
        own = 0.0
        for i in range(3):
            own += (v[k, i] - wind[i]) * axis[i]
        own = turbulence * max(own, v[k, 2] - wind[2] if heat > 0.0 else 0.0, 0.0)
        for i in range(3):
            if turbulence > 0.0:
                gust[k, i] = stay * gust[k, i] + shake * normal(seed, tick, 3 * k + i)
                v[k, i] += own * gust[k, i]
        v[k, 2] -= settling
        for i in range(3):
            x[k, i] += v[k, i] * duration
        x[k, 2] = max(x[k, 2], ground)
        size[k] = math.sqrt((size[k] * math.exp(wider * duration)) ** 2 + 2.0 * diffusion * duration)
        age[k] += duration
    luck[1] = tick + 1
    if rate <= 0.0:
        return
    due[0] += int(rate * duration * 1e9)
    while due[0] >= 1_000_000_000:
        due[0] -= 1_000_000_000
        k = place[0]
        place[0] = (k + 1) % count
        far, turn = radius * math.sqrt(uniform(seed, tick, 8 * k)), 2.0 * math.pi * uniform(seed, tick, 8 * k + 1)
        first = (1.0, 0.0, 0.0) if abs(axis[0]) < 0.7 else (0.0, 1.0, 0.0)
        a = np.array(
            (
                axis[1] * first[2] - axis[2] * first[1],
                axis[2] * first[0] - axis[0] * first[2],
                axis[0] * first[1] - axis[1] * first[0],
            )
        )
        a /= math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
        b = np.array(
            (axis[1] * a[2] - axis[2] * a[1], axis[2] * a[0] - axis[0] * a[2], axis[0] * a[1] - axis[1] * a[0])
        )
        late = uniform(seed, tick, 8 * k + 2) * 0.02 * radius
        for i in range(3):
            x[k, i] = source[i] + far * (math.cos(turn) * a[i] + math.sin(turn) * b[i]) + late * axis[i]
            v[k, i], gust[k, i] = 0.0, 0.0
        size[k], mass[k], age[k] = 0.3 * radius, begun, 0.0
