"""A shelf of boards between two sides."""

from typing import Annotated

from pydantic import Field

from anysim.assets.model import ImportedModel
from anysim_assets.assembly import Assembly

Metres = Annotated[float, Field(gt=0)]


def shelf(
    *,
    size: tuple[Metres, Metres, Metres] = (0.3, 0.6, 0.8),
    boards: Annotated[int, Field(ge=2, le=12, description="with the lowest and the highest")] = 3,
    thickness: Metres = 0.02,
    density: Annotated[float, Field(gt=0, description="[kg/m^3]")] = 600.0,
    color: str = "beige",
) -> ImportedModel:
    """A shelf that stands with the middle of its bottom at the origin, open along x.

    Args:
        size: depth, width and height [m].
        boards: how many lie between the sides, at equal distances.
        thickness: of boards and sides [m].
        density: of all of it.
        color: of all of it, by name.

    Raises:
        ValueError: the boards do not fit above each other.
    """
    depth, width, height = size
    if boards * thickness >= height:
        raise ValueError(f"{boards} boards of {thickness:g} m do not fit into a height of {height:g} m")
    x, y = depth / 2, width / 2
    body = Assembly("shelf")
    for side, at in (("left", y - thickness), ("right", -y)):
        body.board(0, side, (-x, at, 0.0), (x, at + thickness, height), density, color)
    for number in range(boards):
        bottom = number * (height - thickness) / (boards - 1)
        low, high = (-x, -y + thickness, bottom), (x, y - thickness, bottom + thickness)
        body.board(0, f"board_{number}", low, high, density, color)
    body.site(0, "top", (0.0, 0.0, height))
    return body.model()
