"""A bowl: a flared wall of boards in a ring, and a bottom."""

from anysim.assets.model import ImportedModel
from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.world import Cylinder
from anysim_assets.assembly import Assembly, flared_boards
from anysim_schemas.base import Color, Positive
from anysim_schemas.errors import KeyFault

_SEGMENTS = 16  # boards of the wall: at the rim, its corners are 2 % of the radius beyond their middles


def bowl(
    *,
    radius: Positive = 0.08,
    foot: Positive = 0.04,
    height: Positive = 0.06,
    wall: Positive = 0.005,
    density: Positive = 1200.0,
    color: Color = (0.86, 0.87, 0.90),
) -> ImportedModel:
    """A bowl; its frame is in the middle of its bottom, z up.

    Its one link is `base`. Frames: `inside`, the middle of its floor; `rim`, the middle of its opening. Affordance:
    `rim`; as every free thing also `body`. It is made of convex pieces, so that what is in it stays in it on every
    engine.

    Args:
        radius: of the opening, inside [m].
        foot: radius of the bottom [m].
        height: [m].
        wall: thickness of wall and bottom [m].
        density: [kg/m^3].
        color: of the bowl.

    Raises:
        KeyFault: the parts do not fit.
    """
    if foot >= radius:
        raise KeyFault(f"a foot of radius {foot:g} m is not narrower than an opening of {radius:g} m", "foot")
    if wall >= min(height / 2, foot / 2):
        raise KeyFault(f"walls of {wall:g} m leave no room in a height of {height:g} m", "wall")
    body = Assembly("bowl")
    body.solid(0, "bottom", Cylinder(foot, wall / 2), (0.0, 0.0, wall / 2), density, color)
    for i, (board, at, turn) in enumerate(flared_boards(foot, radius, height, wall, _SEGMENTS)):
        body.solid(0, f"wall_{i + 1}", board, at, density, color, turn)
    body.site(0, "inside", (0.0, 0.0, wall))
    body.site(0, "rim", (0.0, 0.0, height))
    walls = tuple(f"base.wall_{i + 1}" for i in range(_SEGMENTS))
    body.afford(Affordance("rim", AffordanceKind.RIM, "rim", walls, ("carry",), ((0.0, 0.0, -1.0),)))
    return body.model()
