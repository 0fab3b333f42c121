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
        "friction multiplies in Bullet: within 0.02 of the pair rule as built, by several shapes a geom where it takes "
        "them; where coefficients are changed later it can be off by 0.45 (0.2 and 0.2 on a ground of 0.8, built with "
        "0.8 throughout). Surfaces are rigid: softness is not simulated. A cylinder rolls {rolling:.0%} too fast down "
        "15 degrees",
        rolling=0.02,
    ),
    Capability.CONTACTS_MOVING: "friction multiplies, as with static things",
    Capability.RESTITUTION: approximately(
        "within {bounce:g} of the coefficient at 1, 2 and 4.2 ms; an impact sinks up to one step's way; "
        "where coefficients are changed later, as near as those of friction",
        bounce=0.05,
    ),
    Capability.MATERIALS: "their colour alone: TinyRenderer has neither gloss nor transparency, and nothing shines",
    Capability.TORSIONAL_FRICTION: "exact on a surface of equal friction; else off as the friction of the pair is",
    Capability.ARMATURE: (
        "a torque computed in each step: exact in free motion; an impact feels the inertia without it, and gets the "
        "rest over the next steps"
    ),
    Capability.MIMIC_JOINTS: approximately("a gear constraint: {lag:g} m in a grip, fingers of 15 g", lag=2.5e-6),
    Capability.JOINT_LIMITS: approximately(
        "met up to one step's way late (21 mm at 11 m/s and 2 ms); at rest under 87 N m within {beyond:g} rad",
        beyond=1e-6,
    ),
    Capability.CONTROL_POSITION: (
        "computed in each step: within 1.3e-3 rad of MuJoCo on a Panda in motion, 1e-7 at rest; what presses against "
        "something builds its force up: within 2 % after 0.37 s for a finger of 15 g, 0.05 s for 1 kg"
    ),
    Capability.ACTUATION_NATIVE: (
        "motors that aim at a velocity: a Panda in free motion within 3.8e-3 rad of the law, 4e-4 at rest; blocked "
        "it pushes with anything up to its effort limit, whatever its error, and its fingers with three quarters of "
        "their command; compensated gravity is worked out in every tenth step; no dry friction on driven joints"
    ),
    Capability.RENDER_SHADOWS: "faint and with gaps: the light sees the scene as coarsely as the camera",
    Capability.RENDER_LIGHTS: (
        "the first light shines, the others light all sides alike with a quarter of their strength; one with a place "
        "shines as if from far away, towards the middle of the bodies"
    ),
    Capability.CONTROL_VELOCITY: "computed in each step, as position control is",
}
_ABSENT = (Capability.SOLVER_SETTINGS,)
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
