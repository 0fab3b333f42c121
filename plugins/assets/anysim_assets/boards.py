"""Things of boards: a hook to reach with."""

from anysim.assets.model import ImportedModel
from anysim.model.affordances import Affordance, AffordanceKind
from anysim_assets.assembly import Assembly
from anysim_schemas.base import Color, Positive
from anysim_schemas.errors import KeyFault


def hook(
    *,
    length: Positive = 0.2,
    reach: Positive = 0.08,
    width: Positive = 0.03,
    density: Positive = 700.0,
    color: Color = (0.80, 0.28, 0.22),
) -> ImportedModel:
    """An L that lies on its side: a handle along x, and at its +x end a hook towards +y.

    Its frame is in the middle of the handle. Frames: `grip`, near the handle's free end; `inner`, the middle of the
    hook's side that pulls, x away from it towards the free end. Affordance: `grip`, from above.

    Args:
        length: of the handle [m].
        reach: of the hook beyond the handle's side [m].
        width: of both boards, and their height [m].
        density: [kg/m^3].
        color: of the hook.

    Raises:
        KeyFault: the handle is shorter than it is wide.
    """
    if length <= 3 * width:
        raise KeyFault(f"a handle of {length:g} m leaves no room for fingers beside a hook {width:g} m wide", "length")
    half, side = length / 2, width / 2
    body = Assembly("hook")
    body.board(0, "handle", (-half, -side, -side), (half, side, side), density, color)
    body.board(0, "hook", (half - width, side, -side), (half, side + reach, side), density, color)
    body.site(0, "grip", (-half + width, 0.0, 0.0))
    body.site(0, "inner", (half - width, side + reach / 2, 0.0), (0.0, 0.0, 1.0, 0.0))
    body.afford(
        Affordance("grip", AffordanceKind.HANDLE, "grip", ("base.handle",), ("carry", "drag"), ((0.0, 0.0, -1.0),))
    )
    return body.model()
