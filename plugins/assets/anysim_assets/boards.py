"""Things of two boards: a hook to reach with, and a T to push about."""

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
    hook's side that pulls, x away from it towards the free end. Affordances: `grip`, from above, and the hook, `inner`.

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
    body.afford(Affordance("inner", AffordanceKind.HOOK, "inner", ("base.hook",), ("drag",)))
    return body.model()


def tee(
    *,
    bar: tuple[Positive, Positive] = (0.2, 0.05),
    stem: tuple[Positive, Positive] = (0.15, 0.05),
    height: Positive = 0.04,
    density: Positive = 1140.0,
    color: Color = (0.35, 0.50, 0.75),
) -> ImportedModel:
    """A T that lies on its side: a bar along x, and a stem from its middle towards -y.

    Its frame is where its mass is in the middle, half its height up. Frames: `bar` and `stem`, the middles of the two.

    Args:
        bar: length and width [m].
        stem: length and width [m].
        height: [m].
        density: [kg/m^3]; 1140 makes 0.8 kg of the size that is set.
        color: of the T.

    Raises:
        KeyFault: the stem is wider than the bar is long.
    """
    if stem[1] >= bar[0]:
        raise KeyFault(f"a stem {stem[1]:g} m wide does not fit below a bar {bar[0]:g} m long", "stem")
    areas = bar[0] * bar[1], stem[0] * stem[1]
    far = (bar[1] + stem[0]) / 2  # between the middles of the two
    top = far * areas[1] / sum(areas)
    low, half = top - far, height / 2
    body = Assembly("tee")
    for name, (length, width), middle in (("bar", bar, top), ("stem", (stem[1], stem[0]), low)):
        corner = (length / 2, width / 2)
        body.board(
            0, name, (-corner[0], middle - corner[1], -half), (corner[0], middle + corner[1], half), density, color
        )
        body.site(0, name, (0.0, middle, 0.0))
    body.afford(Affordance("body", AffordanceKind.BODY, "", ("base.bar", "base.stem"), ("carry", "push")))
    return body.model()
