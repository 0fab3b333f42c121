"""A vial with a screwed-on cap, and a rack of square wells for such."""

from anysim.assets.model import ImportedModel
from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.world import Cylinder
from anysim_assets.assembly import Assembly
from anysim_schemas.base import Color, Integer, Positive
from anysim_schemas.errors import KeyFault


def vial(
    *,
    radius: Positive = 0.014,
    height: Positive = 0.11,
    cap: Positive = 0.03,
    cap_radius: Positive = 0.016,
    density: Positive = 1200.0,
    color: Color = (0.55, 0.75, 0.95),
    cap_color: Color = (0.12, 0.35, 0.65),
) -> ImportedModel:
    """A closed vial; its frame is in the middle of its bottom, z along it. Frame: `cap`, the middle of its cap.

    Args:
        radius: of the body [m].
        height: with the cap [m].
        cap: height of the cap [m].
        cap_radius: of the cap [m].
        density: of all of it [kg/m^3], as of a full one.
        color: of the body.
        cap_color: of the cap.

    Raises:
        KeyFault: the cap is as high as the vial.
    """
    if cap >= height:
        raise KeyFault(f"a cap of {cap:g} m leaves nothing of a vial of {height:g} m", "cap")
    body, glass = Assembly("vial"), height - cap
    body.solid(0, "glass", Cylinder(radius, glass / 2), (0.0, 0.0, glass / 2), density, color)
    body.solid(0, "cap", Cylinder(cap_radius, cap / 2), (0.0, 0.0, glass + cap / 2), density, cap_color)
    body.site(0, "cap", (0.0, 0.0, glass + cap / 2))
    body.afford(Affordance("cap", AffordanceKind.BODY, "cap", ("base.cap",), ("carry",)))
    return body.model()


def rack(
    *,
    wells: tuple[Integer, Integer] = (2, 3),
    well: Positive = 0.036,
    height: Positive = 0.045,
    pitch: Positive = 0.07,
    density: Positive = 900.0,
    color: Color = (0.85, 0.83, 0.78),
) -> ImportedModel:
    """A rack of square wells in rows, open below; its frame is in the middle of its bottom.

    What stands in a well stands on what the rack stands on. Frames: `well_1`, `well_2`, …, the middles of the wells, at
    their lower ends, along y first.

    Args:
        wells: how many along x and y.
        well: edge length of a well [m].
        height: of the rack [m].
        pitch: from the middle of one well to that of the next [m].
        density: [kg/m^3].
        color: of the rack.

    Raises:
        KeyFault: there are no wells, or they overlap.
    """
    if min(wells) < 1:
        raise KeyFault("a rack has at least one well along each axis", "wells")
    if well >= pitch:
        raise KeyFault(f"wells of {well:g} m, {pitch:g} m apart, have no walls", "pitch")
    body, edge = Assembly("rack"), (pitch - well) / 2
    middles = [[pitch * (i - (count - 1) / 2) for i in range(count)] for count in wells]
    x, y = (values[-1] + pitch / 2 for values in middles)
    for number, u in enumerate([-x, *(m + pitch / 2 for m in middles[0])]):  # walls along y, as long as the rack
        low, high = max(u - edge, -x), min(u + edge, x)
        body.board(0, f"across_{number}", (low, -y, 0.0), (high, y, height), density, color)
    for row, u in enumerate(middles[0]):
        for number, v in enumerate([-y, *(m + pitch / 2 for m in middles[1])]):
            low, high = max(v - edge, -y), min(v + edge, y)
            name = f"along_{row}_{number}"
            body.board(0, name, (u - well / 2, low, 0.0), (u + well / 2, high, height), density, color)
    for number, (u, v) in enumerate(((u, v) for u in middles[0] for v in middles[1]), 1):
        body.site(0, f"well_{number}", (u, v, 0.0))
    return body.model()
