"""Declarations of the engine that need no import of MuJoCo: capabilities, with measured errors, and availability."""

from anysim.engine.availability import LibraryRequirement
from anysim.engine.capability import Capabilities, Capability, approximately

LIBRARY = LibraryRequirement(
    "mujoco",
    minimum=(3, 17, 0),
    lacks="has no mujoco.batch",
    remedy="pip install 'mujoco>=3.17,!=4.0.0'",
    wrong={(4, 0, 0): "its sparse solver is wrong where articulated bodies touch each other"},
    also={"mujoco-core": "pip install 'mujoco-core>=4.0.1'"},  # all of MuJoCo 4 that anysim uses
)

_APPROXIMATE = {
    Capability.CONTACTS_STATIC: approximately(
        "soft: a body of 1 kg sinks {sink:g} m under its own weight, {pressed:g} m under 49 kg more; friction creeps "
        "by {creep:g} m/s at 15 degrees and a coefficient of 0.4, less with a larger physics.impratio",
        sink=1.2e-4,
        pressed=2.5e-3,
        creep=7e-4,
    ),
    Capability.CONTACTS_MOVING: "soft, as with static things",
    Capability.EFFORT_LIMITS: approximately(
        "clipped at the speed of the step's beginning: exact when blocked; a stiff drive clipped in motion swings "
        "about its limit (kp 4500, kd 450 on 0.05 kg m^2 at 2 ms: {swing:g} rad off the solution)",
        swing=0.034,
    ),
    Capability.MIMIC_JOINTS: approximately("a stiff soft constraint: {lag:g} m at 20 N on a finger of 15 g", lag=3e-4),
    Capability.MIMIC_CURVES: "a stiff soft constraint, as that of other mimic joints",
    Capability.TENDONS: approximately(
        "damping between joints of different branches acts at the beginning of a step: within {dragged:g} m of the "
        "solution of two sliders",
        dragged=2e-4,
    ),
    Capability.TENDON_LIMITS: "a stiff soft constraint, as that of joint limits",
    Capability.SPATIAL_TENDONS: "their limits are a stiff soft constraint, as those of joints",
    Capability.CONNECTS: approximately("a stiff soft constraint: {apart:g} m at 110 N on 1 kg", apart=2e-5),
    Capability.WELDS: approximately(
        "a stiff soft constraint: {askew:g} rad at 5 N m on a rod of 1 kg, and as a connect", askew=1.3e-3
    ),
    Capability.JOINT_LIMITS: approximately(
        "a stiff soft constraint, met {late:g} step late: {beyond:g} rad beyond at 87 N m on 0.1 kg m^2; a drive whose "
        "dt kd is above its inertia swings on it (kd 300 on 0.115 kg at 2 ms: by {chatter:.0%} of 20 N)",
        late=1.01,
        beyond=5e-4,
        chatter=0.85,
    ),
    Capability.RESTITUTION: approximately(
        "an underdamped contact: within {bounce:g} of the coefficient, {dead:g} left where nothing should bounce; a "
        "ball sinks {dent:g} m for each m/s at 2 ms",
        bounce=0.07,
        dead=0.13,
        dent=7.5e-3,
    ),
    Capability.RENDER_LIGHTS: "one with a place shines in a wide cone about its direction alone",
    Capability.RENDER_SHADOWS: "ground casts none, and they end some metres from the bodies",
    Capability.MATERIALS: "one lamp's highlight, as strong as specular or metallic says; nothing is mirrored",
    Capability.VARYING_ENTITIES: approximately(
        "what is absent takes time, and moves the rest by up to {shift:g} m within 3.6 s", shift=3e-10
    ),
}
_ABSENT = (Capability.SOLVER_SETTINGS, Capability.TERRAIN_TRIMESH)  # MuJoCo collides the convex hull of a mesh
CAPABILITIES = Capabilities.of(
    *(c for c in Capability if c not in _APPROXIMATE and c not in _ABSENT), approximate=_APPROXIMATE
)
