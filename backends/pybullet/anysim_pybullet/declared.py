"""What the engine declares without importing PyBullet: capabilities, with measured errors, and availability."""

import re
from functools import cache
from importlib import metadata

from anysim.engine.capability import Capabilities, Capability
from anysim.engine.state import Availability

MINIMUM = (3, 2, 7)
REMEDY = "pip install 'pybullet>=3.2.7'"

_APPROXIMATE = {
    Capability.CONTACTS: "TBD",
    Capability.RESTITUTION: "TBD",
    Capability.TORSIONAL_FRICTION: "TBD",
    Capability.ARMATURE: "TBD",
    Capability.MIMIC_JOINTS: "TBD",
    Capability.JOINT_LIMITS: "TBD",
}
_ABSENT = (Capability.LIVE_EDIT_NATIVE,)
CAPABILITIES = Capabilities.of(
    *(c for c in Capability if c not in _APPROXIMATE and c not in _ABSENT), approximate=_APPROXIMATE
)

PARAMETERS = frozenset({
    "body.mass", "body.inertia", "geom.friction", "geom.color", "joint.damping", "joint.friction", "joint.armature",
    "actuator.kp", "actuator.kd", "actuator.effort_limit", "world.gravity",
})  # fmt: skip
"""What can be changed per env. Bullet fixes the centre of mass at the build."""


@cache
def installed_version() -> str:
    """The version of the pybullet distribution, or an empty string."""
    try:
        return metadata.version("pybullet")
    except metadata.PackageNotFoundError:
        return ""


def availability() -> Availability:
    """See `SimEngine.availability`."""
    version = installed_version()
    if not version:
        return Availability(False, "", ("the package pybullet is not installed",), REMEDY)
    numbers = tuple(int(n) for n in re.findall(r"\d+", version)[:3])
    if numbers < MINIMUM:
        return Availability(False, version, (f"pybullet {version} is older than 3.2.7",), REMEDY)
    return Availability(True, version)
