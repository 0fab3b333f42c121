"""Solids as Coal, the collision library, has them: for whoever measures distances between shapes."""

from anysim.model.shapes import Box, Capsule, Cylinder, Shape, Sphere


def coal_solid(shape: Shape) -> object | None:
    """A box, ball, capsule or cylinder, in its own frame; None for what is made of triangles, and for ground."""
    import coal  # pyright: ignore[reportMissingImports]  (found by its .pth file)

    match shape:
        case Box((x, y, z)):
            return coal.Box(2 * x, 2 * y, 2 * z)
        case Sphere(radius):
            return coal.Sphere(radius)
        case Capsule(radius, half_length):
            return coal.Capsule(radius, 2 * half_length)
        case Cylinder(radius, half_length):
            return coal.Cylinder(radius, 2 * half_length)
        case _:
            return None
