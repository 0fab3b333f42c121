"""An open tray or bin: a floor and four walls."""

from anysim.assets.model import ImportedModel
from anysim.model.affordances import Affordance, AffordanceKind
from anysim_assets.assembly import Assembly
from anysim_assets.parameters import Size
from anysim_schemas.base import Color, Positive


def tray(
    *, size: Size = (0.3, 0.2, 0.1), wall: Positive = 0.01, density: Positive = 700.0, color: Color = (0.45, 0.55, 0.62)
) -> ImportedModel:
    """A tray, open at the top; its frame is in the middle of its bottom. Frame: `inside`, the middle of its floor.

    Args:
        size: outer length, width and height [m].
        wall: thickness of the floor and the walls [m].
        density: [kg/m^3].
        color: of the tray.

    Raises:
        KeyFault: the walls leave nothing inside.
    """
    body = Assembly("tray")
    body.open_box(0, size, wall, density, color, "size")
    body.site(0, "inside", (0.0, 0.0, wall))
    walls = tuple(f"base.{name}" for name in ("back", "front", "right", "left"))
    body.afford(Affordance("rim", AffordanceKind.RIM, "", walls, ("carry",), ((0.0, 0.0, -1.0),)))
    return body.model()
