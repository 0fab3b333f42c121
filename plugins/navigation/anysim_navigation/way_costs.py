"""Lengths of the ways to many places: what a choice among stands costs a base."""

from contextlib import suppress

import numpy as np

from anysim.conventions import Array
from anysim_navigation.agent import NoRoute
from anysim_navigation.navmesh import NavMesh, length_of
from anysim_navigation.router import SNAP, BaseRouter

TIGHTER = 1.0
"""[m] what a way counts for beside its length for each mesh with more room that has none."""


def way_lengths(router: BaseRouter, ids: Array, start: Array, places: Array) -> Array:
    """(n, C) [m] from starts (n, 2 or more) to places (n, C, 2 or more) over the mesh of each env; inf without a way.

    They are over the mesh with the most room that has one, and tight ones count for more.
    """
    lengths = np.full(places.shape[:2], np.inf)
    for row, env in enumerate(ids.tolist()):
        meshes = list(router.meshes(env))
        for number, place in enumerate(places[row, :, :2]):
            lengths[row, number] = _length(meshes, start[row, :2], place)
    return lengths


def _length(meshes: list[NavMesh], start: Array, place: Array) -> float:
    for number, mesh in enumerate(meshes):
        with suppress(NoRoute):
            path = mesh.path(start, place, snap=SNAP)
            return length_of(np.concatenate([start[None], path[1:-1], place[None]])) + number * TIGHTER
    return float("inf")
