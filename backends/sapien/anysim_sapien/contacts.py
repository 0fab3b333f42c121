"""Contacts as PhysX reports them after a substep: points with the impulse along their normal.

PhysX 5.3 does not report friction, so forces here are normal forces.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.engine.state import ContactPoints
from anysim.world.model import World
from anysim_sapien.scene import EnvScene


def _touching(scene: EnvScene) -> Iterator[tuple[int, int, Any]]:
    """Bodies and the contact of each pair of shapes that PhysX looked at."""
    for contact in scene.contacts():
        first, second = contact.bodies
        yield scene.body_of[first], scene.body_of[second], contact


def sensor_forces(world: World, scene: EnvScene) -> Array:
    """(S, 3) [N]: the net normal force of the last substep on each contact sensor's bodies."""
    sensors = world.contact_sensors
    total = np.zeros((len(sensors), 3))
    if not sensors:
        return total
    for first, second, contact in _touching(scene):
        impulse = sum((np.asarray(point.impulse, dtype=float) for point in contact.points), np.zeros(3))
        if not impulse.any():
            continue
        # the impulse is the one on the first body
        for row, sensor in zip(total, sensors, strict=True):
            for body, other, force in ((first, second, impulse), (second, first, -impulse)):
                if body in sensor.bodies and (sensor.against is None or other in sensor.against):
                    row += force
    return total / world.physics.dt


def contact_points(world: World, scenes: Any, ids: Array) -> ContactPoints:
    """All points that touch or exert force."""
    rows: list[tuple[Any, ...]] = []
    for env in ids:
        for first, second, contact in _touching(scenes[env]):
            for point in contact.points:
                impulse = np.asarray(point.impulse, dtype=float)
                if point.separation <= 0 or impulse.any():
                    # PhysX' normal points from the second body to the first
                    normal, force = -np.asarray(point.normal, dtype=float), -impulse / world.physics.dt
                    place = np.asarray(point.position, dtype=float)
                    rows.append((int(env), first, second, place, normal, force, -float(point.separation)))
    if not rows:
        whole, empty = np.zeros(0, dtype=int), np.zeros((0, 3))
        return ContactPoints(whole, whole, whole, empty, empty, empty, np.zeros(0))
    return ContactPoints(*(np.array(column) for column in zip(*rows, strict=True)))
