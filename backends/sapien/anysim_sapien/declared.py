"""What the engine declares without importing SAPIEN: capabilities, with measured errors, and availability."""

import platform
import re
import sys
from functools import cache
from importlib import metadata

from anysim.engine.capability import Capabilities, Capability
from anysim.engine.state import Availability

MINIMUM = (3, 0, 3)
REMEDY = "pip install 'sapien>=3.0.3'"

_APPROXIMATE = {
    Capability.SHAPE_MESH: "PhysX cooks the hull: 0.2 % less volume on a hull of 64 corners",
    Capability.MIMIC_JOINTS: (
        "a stiff spring: 0.04 mm at 20 N on a gripper's finger; only links with one parent, or a link and its child"
    ),
    Capability.TORSIONAL_FRICTION: (
        "faces resist through their several points, within 4 % of MuJoCo; where one point touches nothing resists: a "
        "ball spins on"
    ),
    Capability.CONTACT_SENSORS: (
        "friction follows from momentum: within 0.2 % of the net force on a body; on a link above a joint with dry "
        "friction off by up to twice that; how several fixed things share the friction of one body is a guess"
    ),
    Capability.CONTACT_POINTS: "the friction of a pair, as sensors have it, is shared as the normal forces are",
}
_ABSENT = (Capability.LIVE_EDIT_NATIVE, Capability.SNAPSHOT_TRAJECTORY)
CAPABILITIES = Capabilities.of(
    *(c for c in Capability if c not in _APPROXIMATE and c not in _ABSENT), approximate=_APPROXIMATE
)


@cache
def installed_version() -> str:
    """The version of the sapien distribution, or an empty string."""
    try:
        return metadata.version("sapien")
    except metadata.PackageNotFoundError:
        return ""


def availability() -> Availability:
    """See `SimEngine.availability`."""
    version = installed_version()
    if not version:
        missing = "the package sapien is not installed"
        if sys.platform.startswith("linux") and platform.machine() not in ("x86_64", "aarch64"):
            missing += f" and has no wheel for {platform.machine()}"
        return Availability(False, "", (missing,), REMEDY)
    numbers = tuple(int(n) for n in re.findall(r"\d+", version)[:3])
    if numbers < MINIMUM:
        return Availability(False, version, (f"sapien {version} is older than 3.0.3",), REMEDY)
    return Availability(True, version)
