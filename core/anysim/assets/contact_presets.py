"""Contact presets: how surfaces give, engine-neutrally, and the surfaces that specs describe."""

from collections.abc import Mapping
from dataclasses import replace

from anysim.model.world import Surface
from anysim_schemas.objects import ContactSpec

PRESETS: Mapping[str, Surface] = {
    "default": Surface(),
    # Stiff rubber pads. With an engine's defaults a 40 N grip sinks millimetres into what it holds and thin handles
    # slip through; 4 ms is twice the usual step of 2 ms, the stiffest that integrates well. The pads' word counts in a
    # pair, and spin about the contact normal is resisted, else a pinched object turns like on a needle.
    "pad": Surface(softness=0.004, impedance=(0.99, 0.999), priority=1, torsional=True),
    # Foam: twice the time constant of the usual defaults and an impedance that stays low.
    "soft": Surface(softness=0.04, impedance=(0.7, 0.9), torsional=True),
}

GRIPPER_LIMIT_SOFTNESS = 0.004
"""[s] of a gripper's joint limits and mimic constraint: as stiff as its pads, else the limit gives before the pad."""


def surface(contact: ContactSpec, friction: float, restitution: float = 0.0) -> Surface:
    """The surface of a contact spec: its preset, with what else the spec gives on top."""
    chosen = replace(PRESETS[contact.preset], friction=friction, restitution=restitution)
    if contact.torsional_friction is not None:
        chosen = replace(
            chosen, torsional_friction=contact.torsional_friction, torsional=contact.torsional_friction > 0
        )
    if contact.rolling_friction is not None:
        chosen = replace(chosen, rolling_friction=contact.rolling_friction)
    if contact.priority is not None:
        chosen = replace(chosen, priority=contact.priority)
    if contact.offset is not None:
        chosen = replace(chosen, contact_offset=contact.offset)
    return chosen
