"""Joints of an object as its spec has them, on top of what its asset says."""

from collections.abc import Mapping
from dataclasses import replace
from fnmatch import fnmatchcase
from math import isfinite
from typing import Any, NamedTuple

from anysim.assets.model import ImportedModel
from anysim.errors import Issues, listing, suggest
from anysim.model.world import Joint
from anysim.randomization.distributions import nominal, written
from anysim_schemas.joints import ObjectJointSpec

_FIELDS = ("initial", "opened", "friction", "damping", "limits")


class JointValue(NamedTuple):
    """A value that a spec gives a joint, and the key of `joints` that it stands under."""

    value: Any
    key: str


def asked_of(joints: Mapping[str, ObjectJointSpec], name: str) -> dict[str, JointValue]:
    """By field what a spec asks of the joint `name`: later patterns win over earlier ones, its own name over all."""
    found: dict[str, JointValue] = {}
    for key, spec in sorted(joints.items(), key=lambda item: item[0] == name):  # stable: else in the order written
        if fnmatchcase(name, key):
            given = {field: getattr(spec, field) for field in _FIELDS if getattr(spec, field) is not None}
            if "initial" in given or "opened" in given:
                found.pop("initial", None)
                found.pop("opened", None)
            found |= {field: JointValue(value, key) for field, value in given.items()}
    return found


def ends(joint: Joint) -> tuple[float, float]:
    """Where a joint is closed and where it is open: the limit that is nearer to zero, and the other one."""
    closed_low = abs(joint.lower) <= abs(joint.upper)
    return (joint.lower, joint.upper) if closed_low else (joint.upper, joint.lower)


def with_joints(model: ImportedModel, joints: Mapping[str, ObjectJointSpec], issues: Issues) -> ImportedModel:
    """The model with what the spec says; what is drawn in each episode enters with its nominal value."""
    if not joints:
        return model
    names = [joint.name for joint in model.joints]
    for key in joints:
        if not any(fnmatchcase(name, key) for name in names):
            issues.add(key, f"there is no joint '{key}'{suggest(key, names)} (joints: {listing(names, 20)})")
    made = [_joint(model, joint, asked_of(joints, joint.name), issues) for joint in model.joints]
    for i, joint in enumerate(made):
        if joint.mimic is not None:
            made[i] = replace(joint, initial=joint.mimic.position(made[joint.mimic.joint].initial))
    return replace(model, joints=tuple(made))


def _joint(model: ImportedModel, joint: Joint, asked: Mapping[str, JointValue], issues: Issues) -> Joint:
    if "limits" in asked:
        lower, upper = asked["limits"].value
        joint = replace(joint, lower=lower, upper=upper, initial=min(max(joint.initial, lower), upper))
    for field in ("friction", "damping"):
        if field in asked:
            joint = replace(joint, **{field: float(nominal(asked[field].value))})
    for field in ("initial", "opened"):
        if field not in asked:
            continue
        value, key = asked[field]
        here = issues.at(key)
        if joint.mimic is not None:
            leader = model.joints[joint.mimic.joint].name
            here.add(field, f"'{joint.name}' follows '{leader}'; give that one its position")
        elif field == "opened":
            if not (isfinite(joint.lower) and isfinite(joint.upper)):
                here.add(field, f"'{joint.name}' has no limits to take a share of; give `initial`, or `limits`")
            else:
                joint = replace(joint, initial=opened_to(joint, float(nominal(value))))
        else:
            for extreme in written(value):
                if not joint.lower <= extreme <= joint.upper:
                    limits = f"[{joint.lower:g}, {joint.upper:g}]"
                    here.add(field, f"{extreme:g} is outside of the limits {limits} of '{joint.name}'")
            joint = replace(joint, initial=min(max(float(nominal(value)), joint.lower), joint.upper))
    return joint


def opened_to(joint: Joint, share: float) -> float:
    """The position where a joint is open by a share of its range."""
    closed, opened = ends(joint)
    return closed + share * (opened - closed)
