"""A gripper with two fingers that slide, to be fixed to the flange of an arm."""

from dataclasses import replace
from math import inf

from anysim.assets.model import ImportedModel
from anysim.compile.physical import GRIPPER_LIMIT_SOFTNESS, surface
from anysim.model.world import JointType, Mimic
from anysim_assets.assembly import Assembly
from anysim_schemas.base import Color, NonNegative, Positive
from anysim_schemas.errors import KeyFault
from anysim_schemas.objects import ContactSpec

_CLEARANCE = 0.001  # [m] between a finger and the palm's face: they must not touch before anything moves


def parallel_gripper(
    *,
    stroke: Positive = 0.085,
    finger_length: Positive = 0.06,
    finger_width: Positive = 0.022,
    finger_thickness: Positive = 0.012,
    pad_length: Positive = 0.03,
    pad_thickness: Positive = 0.004,
    palm_height: Positive = 0.07,
    palm_depth: Positive = 0.06,
    palm_margin: NonNegative = 0.005,
    palm_density: Positive = 1100.0,
    finger_density: Positive = 2700.0,
    pad_density: Positive = 1200.0,
    pad_friction: NonNegative = 1.0,
    force: Positive | None = None,
    speed: Positive | None = None,
    damping: NonNegative = 0.0,
    color: Color = (0.25, 0.26, 0.28),
    finger_color: Color = (0.55, 0.56, 0.58),
    pad_color: Color = (0.10, 0.10, 0.10),
) -> ImportedModel:
    """A palm and two fingers with rubber pads; its frame is in the middle of the palm's back, where it is mounted.

    z points out of the hand and y along the opening. The links and joints `finger_left` (towards +y) and
    `finger_right` (towards -y) are closed at zero and open up to half the stroke each. The right one follows the left,
    as the gears of a real gripper make it: without that nothing would hold what is gripped in the middle. The frame
    `tcp` is in the middle between the pads, z out of the hand, y along the opening. The pads have the contact preset
    `pad`.

    Args:
        stroke: the distance of the pads when fully open [m].
        finger_length: from the palm's face to the tips [m].
        finger_width: of a finger and its pad, along x [m].
        finger_thickness: of a finger behind its pad, along y [m].
        pad_length: of a pad, from the tip backwards [m].
        pad_thickness: [m].
        palm_height: from the mount to the palm's face [m].
        palm_depth: of the palm along x [m].
        palm_margin: how far the palm reaches beyond the open fingers, on each side [m].
        palm_density: of the palm as a solid; a housing with a drive inside weighs as plastic does [kg/m^3].
        finger_density: [kg/m^3], aluminium.
        pad_density: [kg/m^3], rubber.
        pad_friction: sliding friction coefficient of the pads.
        force: effort limit of a finger [N]; none where not given.
        speed: velocity limit of a finger [m/s]; none where not given.
        damping: of a finger's guide [N s/m].
        color: of the palm.
        finger_color: of the fingers.
        pad_color: of the pads.

    Raises:
        KeyFault: the pads do not fit onto the fingers.
    """
    if pad_length > finger_length - _CLEARANCE:
        raise KeyFault(f"a pad of {pad_length:g} m does not fit onto a finger of {finger_length:g} m", "pad_length")
    gripper = Assembly("parallel_gripper")
    x, y = palm_depth / 2, stroke / 2 + pad_thickness + finger_thickness + palm_margin
    gripper.board(0, "palm", (-x, -y, 0.0), (x, y, palm_height), palm_density, color)
    half = finger_width / 2
    for side, sign in (("left", 1.0), ("right", -1.0)):
        finger = gripper.link(
            f"finger_{side}",
            (0.0, 0.0, palm_height),
            JointType.PRISMATIC,
            (0.0, sign, 0.0),
            lower=0.0,
            upper=stroke / 2,
            damping=damping,
        )
        near, far = pad_thickness, pad_thickness + finger_thickness
        for name, inner, outer, start, density, paint in (
            ("rail", near, far, _CLEARANCE, finger_density, finger_color),
            ("pad", 0.0, near, finger_length - pad_length, pad_density, pad_color),
        ):
            low, high = sorted((sign * inner, sign * outer))
            gripper.board(finger, name, (-half, low, start), (half, high, finger_length), density, paint)
    gripper.site(0, "tcp", (0.0, 0.0, palm_height + finger_length - pad_length / 2))
    model = gripper.model()
    rubber = surface(ContactSpec(preset="pad"), pad_friction)
    left, right = (
        replace(j, effort_limit=force or inf, velocity_limit=speed or inf, limit_softness=GRIPPER_LIMIT_SOFTNESS)
        for j in model.joints
    )
    return replace(
        model,
        joints=(left, replace(right, mimic=Mimic(0))),
        geoms=tuple(replace(g, surface=rubber) if g.name.endswith(".pad") else g for g in model.geoms),
    )
