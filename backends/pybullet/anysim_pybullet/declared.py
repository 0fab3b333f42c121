"""Declarations of the engine that need no import of PyBullet: capabilities, with measured errors, and availability."""

from anysim.engine.availability import LibraryRequirement
from anysim.engine.capability import Allowance, Capabilities, Capability, approximately
from anysim.engine.parameters import PARAMETERS as ALL

LIBRARY = LibraryRequirement(
    "pybullet",
    minimum=(3, 2, 7),
    lacks="is not what this backend was measured with",
    remedy="pip install 'pybullet>=3.2.7'",
)

_APPROXIMATE = {
    Capability.CONTACTS_STATIC: approximately(
        "friction multiplies in Bullet: by the pair rule as built, with several shapes a geom where it takes them; "
        "where coefficients are changed later, by {remixed:g} off it between things of 0.2 above a ground of 0.8, "
        "built with 0.8 throughout, and by more where more pairs contradict each other. Surfaces are rigid: softness "
        "is not simulated. A cylinder rolls {rolling:.0%} too fast down 15 degrees",
        remixed=0.05,
        rolling=0.02,
    ),
    Capability.CONTACTS_MOVING: "friction multiplies, as with static things",
    Capability.RESTITUTION: approximately(
        "within {bounce:g} of the coefficient; a ball sinks {dent:g} m for each m/s at 2 ms; where coefficients are "
        "changed later, as near as those of friction",
        bounce=0.05,
        dent=2e-3,
    ),
    Capability.COMPLIANCE: approximately(
        "ignored: contacts, limits, ties are as Bullet has them; a sprung ball sinks by {unyielding:.0%} less",
        unyielding=1.0,
    ),
    Capability.MATERIALS: "their colour alone: TinyRenderer has neither gloss nor transparency, and nothing shines",
    Capability.TORSIONAL_FRICTION: "exact on a surface of equal friction; else off as the friction of the pair is",
    Capability.ARMATURE: (
        "a torque computed in each step: exact in free motion; an impact feels the inertia without it, and gets the "
        "rest over the next steps"
    ),
    Capability.MIMIC_JOINTS: approximately("a gear constraint: {lag:g} m in a grip, fingers of 15 g", lag=2.5e-6),
    Capability.JOINT_LIMITS: approximately(
        "met {late:g} step late; at rest under 87 N m within {beyond:g} rad", late=1.01, beyond=1e-6
    ),
    Capability.CONTROL_POSITION: approximately(
        "computed in each step: within {track:g} rad of the solution in motion, {settled:g} rad at rest (kp 400, kd 40 "
        "on 0.5 kg m^2); a force against something builds up: within {buildup:.0%} after 0.1 s for a finger of 1 kg",
        track=3e-3,
        settled=1e-7,
        buildup=0.02,
    ),
    Capability.ACTUATION_NATIVE: approximately(
        "motors that aim at a velocity: within {astray:g} rad of the law in motion (kp 400, kd 40 on 0.5 kg m^2); "
        "blocked they push with anything up to their effort limit ({stalled:.0%} off where 20 N are asked for and 87 N "
        "allowed); compensated gravity is not worked out in every step; no dry friction on driven joints",
        astray=3e-3,
        stalled=3.4,
    ),
    Capability.RENDER_SHADOWS: (
        "faint and with gaps: the light sees the scene as coarsely as the camera; ground many metres off is dark"
    ),
    Capability.RENDER_LIGHTS: (
        "the first light shines, the others light all sides alike with a quarter of their strength; one with a place "
        "shines as if from far away, towards the middle of the bodies"
    ),
    Capability.CONTROL_VELOCITY: "computed in each step, as position control is",
}
_ABSENT = [
    Capability[name] for name in "SOLVER_SETTINGS MIMIC_CURVES TENDON_LIMITS TENDON_DRIVES SPATIAL_TENDONS".split()
]
CAPABILITIES = Capabilities.of(
    *(c for c in Capability if c not in _APPROXIMATE and c not in _ABSENT), approximate=_APPROXIMATE
)

PARAMETERS = frozenset(ALL) - {"world.shadows"}
"""What can be changed per env."""

LINKS = 127
"""The most links whose states Bullet tells."""

AUDIT_ALLOWANCES = {
    "volume": Allowance(0.001, "Bullet moves the corners of a hull by up to 1e-4 of its size: 0.05 % less volume")
}
