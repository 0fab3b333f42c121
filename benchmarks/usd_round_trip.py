"""Robots to USD files and back: how far masses, inertias, frames and limits are from what was written.

    python benchmarks/usd_round_trip.py [--json docs/usd_round_trip.json] [FILE...]

Without files, the 34 URDF files of example-robot-data that the tests of round trips name. Each is read, written by
`anysim export-model`'s writer, and read again; differences are relative to what is larger than one.
"""

import argparse
import json
import sys
import tempfile
from math import isinf
from pathlib import Path

import numpy as np

from anysim.assets.load import import_asset
from anysim.assets.model import ImportedModel
from anysim.conventions import Array
from anysim.model.world import Body, Site
from anysim_export_model.scene import scene_of_model
from anysim_export_model.write import write

ROOT = Path(__file__).parents[1]
_LIMITS = ("lower", "upper", "velocity_limit", "effort_limit")
_PASSIVE = ("damping", "friction", "armature", "stiffness", "spring_rest", "initial")


def files() -> list[str]:
    """The robots of the tests of round trips."""
    sys.path.insert(0, str(ROOT))
    from tests.plugins.export_model.test_round_trip import FAST, SLOW

    return [f"example-robot-data:{name}" for name in [*FAST, *SLOW]]


def apart(one: Array | list[float], other: Array | list[float]) -> float:
    """The largest difference, relative to what is larger than one; infinite where only one of two is."""
    worst = 0.0
    for a, b in zip(np.ravel(one), np.ravel(other), strict=True):
        if isinf(a) or isinf(b):
            worst = max(worst, 0.0 if a == b else np.inf)
        else:
            worst = max(worst, abs(a - b) / max(1.0, abs(a)))
    return float(worst)


def turned_apart(one: Body | Site, other: Body | Site) -> float:
    """How far two places are apart: a quaternion and its negative are the same turn."""
    first, second = np.array(one.quaternion), np.array(other.quaternion)
    return max(apart(list(one.position), list(other.position)), min(apart(first, second), apart(first, -second)))


def differences(one: ImportedModel, other: ImportedModel) -> dict[str, float]:
    """The largest differences of two models with the same parts, by kind."""
    assert [body.name for body in one.bodies] == [body.name for body in other.bodies]
    assert [joint.name for joint in one.joints] == [joint.name for joint in other.joints]
    ours, theirs = ({site.name: site for site in model.sites} for model in (one, other))
    assert ours.keys() == theirs.keys()
    bodies = list(zip(one.bodies, other.bodies, strict=True))
    joints = list(zip(one.joints, other.joints, strict=True))
    places = [*bodies, *((site, theirs[name]) for name, site in ours.items())]
    following = [(a.mimic, b.mimic) for a, b in joints if a.mimic is not None and b.mimic is not None]
    assert len(following) == sum(joint.mimic is not None for joint in one.joints)
    return {
        "masses": max(apart([a.inertial.mass, *a.inertial.com], [b.inertial.mass, *b.inertial.com]) for a, b in bodies),
        "inertias": max(apart(list(a.inertial.inertia), list(b.inertial.inertia)) for a, b in bodies),
        "frames": max(
            max(turned_apart(a, b) for a, b in places),
            max((apart([*a.axis, *a.anchor], [*b.axis, *b.anchor]) for a, b in joints), default=0.0),
        ),
        "limits": max(
            (apart([getattr(a, k) for k in _LIMITS], [getattr(b, k) for k in _LIMITS]) for a, b in joints), default=0.0
        ),
        "passive": max(
            (apart([getattr(a, k) for k in _PASSIVE], [getattr(b, k) for k in _PASSIVE]) for a, b in joints),
            default=0.0,
        ),
        "mimics": max((apart([a.multiplier, a.offset], [b.multiplier, b.offset]) for a, b in following), default=0.0),
    }


def round_trip(uri: str, folder: Path, *, exact: bool = True) -> dict[str, float]:
    """The differences of a robot after a file; not `exact`: without what anysim alone reads of it."""
    model = import_asset(uri)
    written = write(scene_of_model(model), "usd", folder).files[0]
    if not exact:
        lines = written.read_text("utf-8").splitlines()
        kept = [line for line in lines if "anysim:" not in line or "anysim:name" in line]
        written.write_text("\n".join(kept), "utf-8")
    return differences(model, import_asset(str(written)))


def main() -> None:
    """Try the files and print, or write, a row for each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", metavar="FILE", help="URIs of robots; default: those of the tests")
    parser.add_argument("--json", type=Path, help="write the rows there")
    arguments = parser.parse_args()
    rows = []
    for uri in arguments.files or files():
        with tempfile.TemporaryDirectory() as folder:
            row = {
                "robot": uri,
                "exact": round_trip(uri, Path(folder)),
                "plain": round_trip(uri, Path(folder), exact=False),
            }
        rows.append(row)
        worst = {kind: max(row[kind].values()) for kind in ("exact", "plain")}
        print(f"{uri}: {worst['exact']:.0e}; by the schemas of USD alone {worst['plain']:.0e}", flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()
