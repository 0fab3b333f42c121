"""Contacts of a substep: PhysX' points with the force along their normal, and the friction that goes with them.

PhysX 5.3 reports no friction: it follows from momentum, see `anysim_mechanics.contact_friction`.
"""

import numpy as np

from anysim.model.world import World
from anysim_mechanics.contact_friction import Pair, with_friction
from anysim_sapien.momentum import Momentum
from anysim_sapien.scene import EnvScene


def pairs_of(world: World, scene: EnvScene, momentum: Momentum, env: int) -> list[Pair]:
    """What touched or pressed in the last substep of an env, with friction."""
    found: list[Pair] = []
    coefficients: list[float] = []
    for contact in scene.contacts():
        points = contact.points
        impulse = np.array([p.impulse for p in points], dtype=float).reshape(-1, 3)
        separation = np.array([p.separation for p in points], dtype=float)
        if not (impulse.any() or (separation <= 0).any()):
            continue
        normals = np.array([p.normal for p in points], dtype=float).reshape(-1, 3)
        pressure = np.einsum("pi,pi->p", impulse, normals) / world.physics.dt
        first, second = (scene.body_of[body] for body in contact.bodies)
        position = np.array([p.position for p in points], dtype=float).reshape(-1, 3)
        found.append(Pair(first, second, normals, pressure, position, separation, np.zeros(3)))
        # shapes of a pair have one coefficient, see `anysim_mechanics.collision_groups`
        coefficients.append(float(contact.shapes[0].physical_material.static_friction))
    return with_friction(found, coefficients, momentum.balance(env))
