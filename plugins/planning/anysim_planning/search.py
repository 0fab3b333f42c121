"""RRT-Connect and shortcuts, with the configurations of an edge checked in one batch."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from anysim.conventions import Array
from anysim.planning.motion import Budget
from anysim_planning.scene import PlanningWorld

NODES = 3000
"""Of both trees together, after which a search gives up; it bounds the search on every machine alike."""
REACH = 1.0
"""The longest edge of a tree."""


def filled(a: Array, b: Array, step: float) -> Array:
    """Configurations (n, K) after `a` up to `b`, no joint moving by more than `step` between two."""
    count = max(1, int(np.ceil(np.abs(b - a).max() / step)))
    return a + (b - a) * (np.arange(1, count + 1) / count)[:, None]


def dense(path: Array, step: float) -> Array:
    """A path (M, K) filled up."""
    return np.concatenate([path[:1], *(filled(a, b, step) for a, b in pairwise(path))])


def edge_check(world: PlanningWorld, step: float) -> Callable[[Array, Array], bool]:
    """Whether the straight edge after `a` up to `b` is free: its end and its middle first, then all of it."""

    def free(a: Array, b: Array) -> bool:
        rows = filled(a, b, step)
        if (
            len(rows) > 8
            and world.hits(rows[[-1, len(rows) // 2, len(rows) // 4, 3 * len(rows) // 4]], stop=True).any()
        ):
            return False
        return not any(world.hits(rows[i : i + 64], stop=True).any() for i in range(0, len(rows), 64))

    return free


class _Tree:
    def __init__(self, root: Array) -> None:
        self.rows = np.empty((64, len(root)))
        self.rows[0], self.parents = root, [-1]

    def nearest(self, q: Array) -> int:
        away = self.rows[: len(self.parents)] - q
        return int(np.argmin(np.einsum("ij,ij->i", away, away)))

    def add(self, q: Array, parent: int) -> int:
        if len(self.parents) == len(self.rows):
            self.rows = np.concatenate([self.rows, np.empty_like(self.rows)])
        self.rows[len(self.parents)] = q
        self.parents.append(parent)
        return len(self.parents) - 1

    def path(self, node: int) -> list[Array]:
        """From the root to a node."""
        rows: list[Array] = []
        while node >= 0:
            rows.append(self.rows[node].copy())
            node = self.parents[node]
        return rows[::-1]


def connect(
    start: Array,
    goal: Array,
    lower: Array,
    upper: Array,
    free: Callable[[Array, Array], bool],
    rng: np.random.Generator,
    budget: Budget,
) -> Array | None:
    """A free path (M, K) by two trees that grow towards each other; None if there is none within the bounds."""
    if free(start, goal):
        return np.stack([start, goal])
    low, high = np.minimum(lower, np.minimum(start, goal)), np.maximum(upper, np.maximum(start, goal))
    low, high = np.where(np.isfinite(low), low, start - 2 * np.pi), np.where(np.isfinite(high), high, start + 2 * np.pi)
    trees, swapped, spread = (_Tree(start), _Tree(goal)), False, 0
    while sum(len(tree.parents) for tree in trees) < NODES and spread < 2 * NODES:
        if budget.spent:
            return None
        spread += 1
        one, other = trees[::-1] if swapped else trees
        swapped = not swapped
        near = one.nearest(sample := rng.uniform(low, high))
        added = _grow(one, near, sample, free)
        if added is None:
            continue
        target = one.rows[added]
        node = other.nearest(target)
        while (nearer := _grow(other, node, target, free)) is not None:
            node = nearer
            if np.array_equal(other.rows[node], target):
                first, second = one.path(added), other.path(node)[::-1]
                rows = first + second[1:]
                return np.stack(rows if one is trees[0] else rows[::-1])
    return None


def _grow(tree: _Tree, near: int, target: Array, free: Callable[[Array, Array], bool]) -> int | None:
    a = tree.rows[near]
    away = float(np.linalg.norm(target - a))
    b = target if away <= REACH else a + (target - a) * (REACH / away)
    return tree.add(b, near) if away > 0 and free(a, b) else None


def shortened(
    path: Array, free: Callable[[Array, Array], bool], rng: np.random.Generator, budget: Budget, tries: int = 80
) -> Array:
    """A path with pieces replaced by straight ones where these are free."""
    for _ in range(tries):
        if len(path) < 3 or budget.spent:
            break
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        low, high = np.sort(rng.uniform(0.0, length[-1], 2))
        i, j = (int(np.clip(np.searchsorted(length, v, side="right") - 1, 0, len(path) - 2)) for v in (low, high))
        if i == j:
            continue
        a, b = (
            path[k] + (path[k + 1] - path[k]) * (v - length[k]) / max(length[k + 1] - length[k], 1e-12)
            for k, v in ((i, low), (j, high))
        )
        if free(a, b):
            path = np.concatenate([path[: i + 1], [a, b], path[j + 1 :]])
            path = path[np.concatenate([[True], np.abs(np.diff(path, axis=0)).max(axis=1) > 1e-9])]
    return path
