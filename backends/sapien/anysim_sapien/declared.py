"""Declarations of the engine that need no import of SAPIEN: capabilities, with measured errors, and availability."""

from anysim.engine.availability import LibraryRequirement
from anysim.engine.capability import Allowance, Capabilities, Capability, approximately
from anysim.engine.parameters import PARAMETERS as ALL

LIBRARY = LibraryRequirement(
    "sapien",
    minimum=(3, 0, 3),
    lacks="has other joint frames and collision groups",
    remedy="pip install 'sapien>=3.0.3'",
    machines=("x86_64", "aarch64"),
)

_APPROXIMATE = {
    Capability.CONTACTS_STATIC: approximately(
        "a cylinder is a prism of many sides: it rolls {rolling:.0%} slower than a round one down 15 degrees",
        rolling=0.13,
    ),
    Capability.SHAPE_MESH: "PhysX cooks hulls anew and drops corners near others: a small one loses some of its volume",
    Capability.MIMIC_JOINTS: approximately(
        "a stiff spring: {lag:g} m at 20 N on a gripper's finger; only links with one parent, or a link and its child",
        lag=5e-5,
    ),
    Capability.TENDONS: approximately(
        "damping between two joints acts at the beginning of a step, that of each at its end: within {dragged:g} m of "
        "the solution of two sliders",
        dragged=2e-4,
    ),
    Capability.WELDS: approximately("a stiff drive keeps them from turning: {askew:g} rad at 5 N m", askew=3e-5),
    Capability.ACTUATION_NATIVE: approximately(
        "PhysX takes the stiffness implicitly too: within {astray:g} rad of the law in motion (kp 400, kd 40 on 0.5 kg "
        "m^2), blocked within {stalled:.1%}. The effort limit bounds a driven joint's own damping with the drive",
        astray=2.5e-3,
        stalled=0.006,
    ),
    Capability.TORSIONAL_FRICTION: approximately(
        "faces resist through their several points; where one point touches {torsion:.0%} of the torque are missing: a "
        "ball spins on",
        torsion=1.0,
    ),
    Capability.CONTACT_SENSORS: approximately(
        "friction follows from momentum: within {felt:.1%} of the net force on a body; on a link above a joint with "
        "dry friction off by more; how several fixed things share the friction of one body is a guess",
        felt=0.005,
    ),
    Capability.RENDER_DEPTH: (
        "in software, corners of triangles are on a grid a part of a pixel wide: depth is that of a point beside the "
        "middle of the pixel, most so on ground that reaches behind the camera; along a plane, in few rows, it is some "
        "percent off"
    ),
    Capability.COMPLIANCE: approximately(
        "ignored: contacts, limits, ties are as PhysX has them; a sprung ball sinks by {unyielding:.0%} less",
        unyielding=1.0,
    ),
    Capability.MATERIALS: (
        "the shader `lit`, which `auto` takes without a graphics card, has highlights and mirrors nothing; `trivial` "
        "shows colours and opacity alone, `default` is physically based"
    ),
    Capability.CONTACT_POINTS: "the friction of a pair, as sensors have it, is shared as the normal forces are",
}
_ABSENT = [
    Capability[name] for name in "RENDER_SHADOWS MIMIC_CURVES TENDON_LIMITS TENDON_DRIVES SPATIAL_TENDONS".split()
]
CAPABILITIES = Capabilities.of(
    *(c for c in Capability if c not in _APPROXIMATE and c not in _ABSENT), approximate=_APPROXIMATE
)

PARAMETERS = frozenset(ALL) - {"world.shadows"}
"""What can be changed per env."""

JOINTS = 254
"""The most joints of an articulation of PhysX."""

AUDIT_ALLOWANCES = {
    "volume": Allowance(
        0.07,
        "PhysX cooks hulls anew and drops corners within 0.7 mm of the rest: 0.2 % of a hand's volume, "
        "up to 6 % at 3 cm",
    )
}
