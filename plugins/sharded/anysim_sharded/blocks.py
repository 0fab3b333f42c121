"""Blocks of envs by worker, and joins of the rows of several workers into one array."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.state import ContactPoints
from anysim.model.world import World
from anysim_processes.shared_memory import Layout


class WorkerRows(NamedTuple):
    """The envs of a call that one worker holds: their rows in the call, and their numbers in the worker."""

    worker: int
    rows: Array
    ids: Array


class Blocks:
    """Contiguous blocks of nearly equal size: `bounds[k]` are the first env of worker k and the one after its last."""

    def __init__(self, num_envs: int, workers: int) -> None:
        size, more = divmod(num_envs, workers)
        stops = np.cumsum([size + (k < more) for k in range(workers)]).tolist()
        self.bounds = tuple(zip([0, *stops[:-1]], stops, strict=True))

    def split(self, ids: Array) -> list[WorkerRows]:
        """Parts of a call for envs `ids`, without workers that have none of them."""
        parts: list[WorkerRows] = []
        for worker, (first, stop) in enumerate(self.bounds):
            rows = np.flatnonzero((ids >= first) & (ids < stop))
            if len(rows):
                parts.append(WorkerRows(worker, rows, ids[rows] - first))
        return parts

    def split_query(self, ids: Array) -> list[WorkerRows]:
        """The same; a query for no env goes to the first worker, which knows the shapes of nothing."""
        return self.split(ids) or [WorkerRows(0, np.arange(0), ids)]


def joined(pieces: Sequence[tuple[Array, Array]], size: int) -> Array:
    """One array (size, ...) of pieces (rows, values); where trailing sizes differ, the smaller are padded with 0."""
    first = pieces[0][1]
    shape = tuple(max(sizes) for sizes in zip(*(values.shape[1:] for _, values in pieces), strict=True))
    whole = np.zeros((size, *shape), first.dtype)
    for rows, values in pieces:
        whole[(rows, *(slice(n) for n in values.shape[1:]))] = values
    return whole


def joined_by_name(pieces: Iterable[tuple[Array, Mapping[str, Array]]], size: int) -> dict[str, Array]:
    """`joined` for each of the arrays that all pieces have."""
    held = list(pieces)
    return {name: joined([(rows, data[name]) for rows, data in held], size) for name in held[0][1]}


def joined_contacts(found: Sequence[tuple[ContactPoints, WorkerRows]], blocks: Blocks, ids: Array) -> ContactPoints:
    """The contacts of all workers, with the envs' numbers, in the order in which `ids` asks for the envs."""
    columns = zip(*(c._replace(env=c.env + blocks.bounds[part.worker][0]) for c, part in found), strict=True)
    points = ContactPoints(*map(np.concatenate, columns))
    place = np.zeros(blocks.bounds[-1][1], dtype=int)
    place[ids] = np.arange(len(ids))
    order = np.argsort(place[points.env], kind="stable")
    return ContactPoints(*(column[order] for column in points))


def rows_of(rows: Array, *arrays: Array | None) -> list[Array | None]:
    """These rows of the arrays that there are."""
    return [None if array is None else array[rows] for array in arrays]


def state_layout(world: World, num_envs: int) -> Layout:
    """The arrays of an engine: the commands, the wrenches and the fields of a `State`, of all envs."""
    n, a, b, j = num_envs, len(world.actuators), len(world.bodies), len(world.joints)
    double = np.dtype(np.float64).str
    return {
        "control.position": ((n, a), double),
        "control.velocity": ((n, a), double),
        "control.effort": ((n, a), double),
        "control.mode": ((n, a), np.dtype(np.int8).str),
        "wrench": ((n, b, 6), double),
        "body_pose": ((n, b, 7), double),
        "body_twist": ((n, b, 6), double),
        "joint_pos": ((n, j), double),
        "joint_vel": ((n, j), double),
        "joint_effort": ((n, j), double),
        "contact_force": ((n, len(world.contact_sensors), 3), double),
        "fault": ((n,), np.dtype(bool).str),
    }
