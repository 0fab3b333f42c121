"""Compiled ways over triangles: A* from edge to edge, and the funnel that pulls a way taut."""

import heapq
import math

import numpy as np

from anysim.conventions import Array
from anysim.math.compiled import compiled

NONE, END = -1, -2
APART, MOST = 0.4, 8
"""[m] between points of an edge that are looked at, and the most of them."""


@compiled
def _side(ax: float, ay: float, bx: float, by: float, px: float, py: float) -> float:
    """Twice the area of a triangle: positive where p is to the left of the line from a to b."""
    return (bx - ax) * (py - ay) - (by - ay) * (px - ax)


@compiled
def triangle_at(vertices: Array, triangles: Array, x: float, y: float, slack: float) -> int:
    """The triangle that holds a point, with a slack [m] at its edges: the one that it is deepest in; -1 if none."""
    best, most = NONE, -slack
    for t in range(len(triangles)):
        depth = np.inf
        for k in range(3):
            a, b = triangles[t, k], triangles[t, (k + 1) % 3]
            ax, ay, bx, by = vertices[a, 0], vertices[a, 1], vertices[b, 0], vertices[b, 1]
            length = math.hypot(bx - ax, by - ay)
            if length == 0.0:
                depth = -np.inf
                break
            depth = min(depth, _side(ax, ay, bx, by, x, y) / length)
            if depth < most:
                break
        if depth >= most:
            best, most = t, depth
    return best


@compiled
def _samples(length: float) -> int:
    """So many points of an edge are ways over it: both ends, at which taut ways bend, and some between."""
    return min(MOST, 2 + int(length / APART))


@compiled
def corridor(
    vertices: Array, triangles: Array, neighbours: Array, first: int, last: int, start: Array, goal: Array
) -> Array:
    """Half edges (K,), each 3 * triangle + edge that is left, from the first triangle to the last.

    A* over points of the edges, from each to those of the other two edges of the triangle that it leads into.
    """
    count = 3 * len(triangles) * MOST
    cost, came = np.full(count, np.inf), np.full(count, NONE, dtype=np.int64)
    at, done = np.empty((count, 2)), np.zeros(count, dtype=np.bool_)
    heap, best, came_last = [(0.0, NONE)], np.inf, NONE
    while len(heap) > 0:
        _, node = heapq.heappop(heap)
        edge = NONE
        if node == NONE:
            triangle, x, y, gone = first, start[0], start[1], 0.0
        elif node == END:
            node, length = came_last, 0
            here = node
            while here != NONE:
                length, here = length + 1, came[here]
            found = np.empty(length, dtype=np.int64)
            here = node
            for k in range(length - 1, -1, -1):
                found[k], here = here // MOST, came[here]
            return found
        else:
            if done[node]:
                continue
            done[node], edge = True, node // MOST
            triangle, x, y, gone = neighbours[edge // 3, edge % 3], at[node, 0], at[node, 1], cost[node]
        if triangle == last:
            way = gone + math.hypot(goal[0] - x, goal[1] - y)
            if way < best:
                best, came_last = way, node
                heapq.heappush(heap, (way, END))
            continue
        for k in range(3):
            other = neighbours[triangle, k]
            if other == NONE or (edge != NONE and other == edge // 3):
                continue
            a, b = triangles[triangle, k], triangles[triangle, (k + 1) % 3]
            ax, ay, bx, by = vertices[a, 0], vertices[a, 1], vertices[b, 0], vertices[b, 1]
            points = _samples(math.hypot(bx - ax, by - ay))
            for s in range(points):
                share = s / (points - 1)
                qx, qy = ax + share * (bx - ax), ay + share * (by - ay)
                way, index = gone + math.hypot(qx - x, qy - y), (3 * triangle + k) * MOST + s
                if way < cost[index] and not done[index]:
                    cost[index], came[index] = way, node
                    at[index, 0], at[index, 1] = qx, qy
                    heapq.heappush(heap, (way + math.hypot(goal[0] - qx, goal[1] - qy), index))
    return np.empty(0, dtype=np.int64)


@compiled
def taut(vertices: Array, triangles: Array, edges: Array, start: Array, goal: Array) -> Array:
    """The shortest way (K, 2) [m] through a corridor of half edges (the funnel of Lee and Preparata)."""
    portals = len(edges) + 2
    left, right = np.empty((portals, 2)), np.empty((portals, 2))
    left[0], right[0] = start, start
    left[portals - 1], right[portals - 1] = goal, goal
    for k in range(len(edges)):  # triangles run counter-clockwise: who leaves over an edge has its second end at left
        t, e = edges[k] // 3, edges[k] % 3
        right[k + 1], left[k + 1] = vertices[triangles[t, e]], vertices[triangles[t, (e + 1) % 3]]
    found = np.empty((2 * portals + 2, 2))
    found[0], count = start, 1
    ax, ay = start[0], start[1]
    at_left, at_right, k = 0, 0, 1
    lx, ly, rx, ry = ax, ay, ax, ay
    while k < portals:
        if _side(ax, ay, rx, ry, right[k, 0], right[k, 1]) >= 0.0:
            if (ax == rx and ay == ry) or _side(ax, ay, lx, ly, right[k, 0], right[k, 1]) < 0.0:
                rx, ry, at_right = right[k, 0], right[k, 1], k
            else:  # the right side has crossed the left: the corner of the left is on the way
                ax, ay = lx, ly
                found[count, 0], found[count, 1] = ax, ay
                count += 1
                k = at_right = at_left
                lx, ly, rx, ry = ax, ay, ax, ay
                k += 1
                continue
        if _side(ax, ay, lx, ly, left[k, 0], left[k, 1]) <= 0.0:
            if (ax == lx and ay == ly) or _side(ax, ay, rx, ry, left[k, 0], left[k, 1]) > 0.0:
                lx, ly, at_left = left[k, 0], left[k, 1], k
            else:
                ax, ay = rx, ry
                found[count, 0], found[count, 1] = ax, ay
                count += 1
                k = at_left = at_right
                lx, ly, rx, ry = ax, ay, ax, ay
                k += 1
                continue
        k += 1
    if found[count - 1, 0] != goal[0] or found[count - 1, 1] != goal[1]:
        found[count] = goal
        count += 1
    return found[:count].copy()


@compiled
def parts(neighbours: Array) -> Array:
    """(T,) the connected part that each triangle is in."""
    part, stack = np.full(len(neighbours), NONE, dtype=np.int64), np.empty(len(neighbours), dtype=np.int64)
    count = 0
    for seed in range(len(neighbours)):
        if part[seed] != NONE:
            continue
        part[seed], stack[0], top = count, seed, 1
        while top > 0:
            top -= 1
            for other in neighbours[stack[top]]:
                if other != NONE and part[other] == NONE:
                    part[other], stack[top] = count, other
                    top += 1
        count += 1
    return part
