"""Declarations of the engine that need no import of MuJoCo: capabilities, with measured errors, and availability."""

from anysim.engine.availability import LibraryRequirement
from anysim.engine.capability import Capabilities, Capability, approximately

LIBRARY = LibraryRequirement(
    "mujoco",
    minimum=(3, 17, 0),
    lacks="has no mujoco.batch",
    remedy="pip install 'mujoco>=3.17,!=4.0.0'",
    wrong={(4, 0, 0): "its sparse solver is wrong where articulated bodies touch each other"},
)

_APPROXIMATE = {
    Capability.CONTACTS_STATIC: approximately(
        "soft: a body sinks {sink:g} m under its own weight, 5 mm under 50 times that, a finger of 50 g 0.45 mm at 3 N;"
        " friction creeps by {creep:g} m/s at 15 degrees and a coefficient of 0.4, a tenth with physics.impratio=10",
        sink=1.2e-4,
        creep=7e-4,
    ),
    Capability.CONTACTS_MOVING: "soft, as with static things",
    Capability.EFFORT_LIMITS: approximately(
        "clipped at the speed of the step's beginning: exact when blocked; a stiff drive that is clipped in motion "
        "swings about its limit (kp 4500, kd 450 on 0.05 kg m^2 at 2 ms: {swing:g} rad off the solution)",
        swing=0.034,
    ),
    Capability.MIMIC_JOINTS: approximately("a stiff soft constraint: {lag:g} m at 20 N on a finger of 15 g", lag=3e-4),
    Capability.JOINT_LIMITS: approximately(
        "a stiff soft constraint: {beyond:g} rad beyond, pressed with 87 N m on 0.1 kg m^2; where the dt kd of a drive "
        "is above the inertia it moves, its force on a limit swings (kd 300 on 0.115 kg at 2 ms: 3 to 25 N about 20 N)",
        beyond=5e-4,
    ),
    Capability.RESTITUTION: approximately(
        "an underdamped contact: within {bounce:g} of the coefficient, within 0.04 from 0.5 on; it sinks 6 mm "
        "per m/s at 2 ms; 0 gives {dead:g}",
        bounce=0.07,
        dead=0.13,
    ),
    Capability.RENDER_LIGHTS: "one with a place shines within 80 degrees of its direction alone",
    Capability.MATERIALS: (
        "one lamp's highlight: as strong as specular or metallic says, as small as it is smooth; nothing is mirrored"
    ),
    Capability.VARYING_ENTITIES: (
        "what is absent stays in the model, where nothing meets it: the rest moves within 3e-10 m over 3.6 s of a "
        "world without it, contacts included. It still takes time: 10 absent objects beside a Panda and 5 that are "
        "there make a step 1.5 times as long, 25 of them 1.9 times"
    ),
}
_ABSENT = (Capability.SOLVER_SETTINGS, Capability.TERRAIN_TRIMESH)  # MuJoCo collides the convex hull of a mesh
CAPABILITIES = Capabilities.of(
    *(c for c in Capability if c not in _APPROXIMATE and c not in _ABSENT), approximate=_APPROXIMATE
)
