"""Tables that the kernels read: geoms of a World, triangles with their trees, and where all of it is now.

Numba's cache names these classes, fails where it cannot find one, and does not notice that fields changed places:
rename none, and when one changes change every file of kernels too.
"""

from typing import NamedTuple

from anysim.conventions import Array

PLANE, BOX, SPHERE, CAPSULE, CYLINDER, TRIANGLES = range(6)
"""Kinds of geoms. Kernels are compiled with these numbers, and numba's cache would not notice a change."""


class Geoms(NamedTuple):
    """G geoms, in the order of the World.

    Attributes:
        kind: (G,) int32, see above.
        size: (G, 3) half sizes of a box; radius, and half length, of what is round [m].
        frame: (G, 12) the rotation matrix by rows and the position in the frame of its body (or of the world).
        body: (G,) int32, -1 for the world.
        entity: (G,) int32, -1 for none.
        mesh: (G,) int32, the row of `Triangles.root`, -1 for other kinds.
        sheet: (G,) bool, ground of triangles: solid below.
        low, high: (G, 3) the box around its triangles, in its own frame; zeros for other kinds.
        number: (G,) int32, its index among the World's geoms.
    """

    kind: Array
    size: Array
    frame: Array
    body: Array
    entity: Array
    mesh: Array
    sheet: Array
    low: Array
    high: Array
    number: Array


class Triangles(NamedTuple):
    """The triangles of all meshes, those of a leaf of a tree next to each other, and the trees.

    Attributes:
        root: (M,) int32, the first node of each mesh.
        box: (K, 6) low and high corner of each node, in the mesh's frame.
        link: (K, 2) int32: number of triangles of a leaf and the first of them, or 0 and the right child; the left
            one is the next node.
        corner: (T, 9) the first corner, and the edges to the second and the third.
        neighbour: (T, 3) int32, the triangle across each edge (first to second corner, …), -1 for none.
        vertex: (T, 3) int32, rows of `normal`.
        normal: (V, 3) of the vertices, triangles weighted by their angle; of no particular length.
    """

    root: Array
    box: Array
    link: Array
    corner: Array
    neighbour: Array
    vertex: Array
    normal: Array


class GeomPoses(NamedTuple):
    """Where the geoms of N envs are.

    Attributes:
        frame: (N, G, 12) rotation matrices by rows and positions, world frame.
        low, high: (N, G, 3) [m] boxes around the geoms.
        there: (N, G) bool.
        box, link, order: a tree over the geoms of each env, (N, K, 6), (N, K, 2) as in `Triangles`, (N, G) int32 the
            geoms in its order; K is 0 where there are so few geoms that none is made.
    """

    frame: Array
    low: Array
    high: Array
    there: Array
    box: Array
    link: Array
    order: Array
