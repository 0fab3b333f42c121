"""A serving spoon with a flat bottom: a bowl of boards and a straight handle."""

from anysim.assets.model import ImportedModel
from anysim_assets.assembly import Assembly
from anysim_assets.parameters import Size
from anysim_schemas.base import Color, Positive


def spoon(
    *,
    bowl: Size = (0.06, 0.05, 0.028),
    wall: Positive = 0.004,
    handle: Size = (0.14, 0.016, 0.02),
    density: Positive = 900.0,
    color: Color = (0.75, 0.77, 0.80),
    handle_color: Color = (0.25, 0.35, 0.60),
) -> ImportedModel:
    """A spoon that lies level; its frame is in the middle of its bowl's bottom, z up, and its handle is at -x.

    Its one link is `base`. Frames: `inside`, the middle of the bowl's floor; `tip`, the middle of its front rim;
    `grip`, the middle of the handle. It is made of boxes, so that what is in it stays in it on every engine.

    Args:
        bowl: outer length, width and height of the bowl [m].
        wall: thickness of its floor and walls [m].
        handle: length, width and height of the handle, which lies on what the bowl lies on [m].
        density: of all parts [kg/m^3].
        color: of the bowl.
        handle_color: of the handle.

    Raises:
        KeyFault: the walls leave nothing inside.
    """
    x, z = bowl[0] / 2, bowl[2]
    body = Assembly("spoon")
    body.open_box(0, bowl, wall, density, color, "bowl")
    length, width, height = handle
    body.board(0, "handle", (-x - length, -width / 2, 0.0), (-x, width / 2, height), density, handle_color)
    body.site(0, "inside", (0.0, 0.0, wall))
    body.site(0, "tip", (x, 0.0, z))
    body.site(0, "grip", (-x - length / 2, 0.0, height / 2))
    return body.model()
