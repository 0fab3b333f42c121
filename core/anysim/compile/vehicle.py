"""Checks of a vehicle: its catalogue entry against its model."""

from collections.abc import Iterable, Sequence
from math import isfinite

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.conventions import Array
from anysim.errors import Issues, listing, suggest
from anysim.math import pose as P
from anysim.model.world import Joint, JointType
from anysim_schemas.robot_model import RobotModelSpec
from anysim_schemas.vehicle import AckermannSpec, DifferentialSpec, PlanarSpec, SwerveSpec, joints_of, wheels_of

_SLACK = 2e-3  # [m] between the entry and the model: a wheel's place to the millimetre, rounded
_AXIS = 1e-3


class _Frames:
    """Where joints are and how they point, in the root's frame with all joints at zero."""

    def __init__(self, model: ImportedModel) -> None:
        poses: list[Array] = []
        for body in model.bodies:
            own = P.pose(body.position, body.quaternion)
            poses.append(own if body.parent < 0 else P.compose(poses[body.parent], own))
        self._poses = poses
        self.joints = {joint.name: joint for joint in model.joints}

    def place(self, name: str) -> Array:
        """(3,) of the joint's anchor [m]."""
        joint = self.joints[name]
        frame = self._poses[joint.body]
        return frame[:3] + P.rotate(frame[3:], np.array(joint.anchor))

    def axis(self, name: str) -> Array:
        """(3,) the joint's axis."""
        joint = self.joints[name]
        return P.rotate(self._poses[joint.body][3:], np.array(joint.axis))


def check_vehicle(entry: RobotModelSpec, model: ImportedModel, issues: Issues) -> None:
    """Note in `issues`, at the entry, what of `vehicle` and `base` does not fit the model or the channels."""
    vehicle, own = entry.vehicle, issues.at("vehicle")
    if entry.base == "planar" and not isinstance(vehicle, PlanarSpec):
        issues.add("base", "a `planar` base needs `vehicle: {kind: planar}`, which says how it is driven")
    if vehicle is None:
        return
    frames = _Frames(model)
    names = joints_of(vehicle)
    unknown = [name for name in names if name not in frames.joints]
    for name in unknown:
        known = f"{suggest(name, list(frames.joints))} (joints: {listing(frames.joints, 20)})"
        own.add("", f"the robot '{entry.name}' has no joint '{name}'{known}")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        own.add("", f"{listing(twice)}: one joint cannot be two parts of a vehicle")
    if unknown or twice:
        return
    _check_channel(entry, names, own)
    _check_wheels(vehicle, frames, own)
    match vehicle:
        case DifferentialSpec():
            _check_pair(frames, vehicle.left, vehicle.right, vehicle.track, own)
        case AckermannSpec():
            _check_car(vehicle, frames, own)
        case SwerveSpec():
            _check_swerve(vehicle, frames, own)
        case PlanarSpec():
            _check_planar(vehicle, frames, own)


def _check_channel(entry: RobotModelSpec, names: Sequence[str], own: Issues) -> None:
    """One controller drives them, so one channel has them all."""
    channels = {channel: set(spec.joints) & set(names) for channel, spec in entry.channels.items()}
    if any(set(names) == found for found in channels.values()):
        return
    spread = "; ".join(f"{channel}: {listing(sorted(found))}" for channel, found in channels.items() if found)
    missing = [name for name in names if not any(name in found for found in channels.values())]
    words = f" (in none: {listing(missing)})" if missing else ""
    own.add("", f"one channel must have all joints of the vehicle; now {spread or 'no channel has any'}{words}")


def _check_wheels(
    vehicle: DifferentialSpec | AckermannSpec | SwerveSpec | PlanarSpec, frames: _Frames, own: Issues
) -> None:
    """Wheels turn for ever, about y, positive forward."""
    for name in wheels_of(vehicle):
        _turns(frames.joints[name], own, endless=True)
        _points(frames, name, 1, "a wheel turns about y of the base, so that positive rolls forward", own)


def _check_pair(frames: _Frames, left: str, right: str, track: float, own: Issues) -> None:
    """Left is left of right, by the track, on one line."""
    gap = frames.place(left) - frames.place(right)
    if gap[1] <= 0:
        own.add("", f"'{left}' is on the right of '{right}'; exchange the two")
    elif abs(gap[1] - track) > _SLACK:
        own.add("track", f"is {track:g} m, but '{left}' and '{right}' are {gap[1]:.4g} m apart")
    if abs(gap[0]) > _SLACK:
        own.add("", f"'{left}' is {gap[0]:.4g} m in front of '{right}'; the wheels of an axle are beside each other")


def _check_car(car: AckermannSpec, frames: _Frames, own: Issues) -> None:
    if (car.front_left is None) != (car.front_right is None):
        own.add("", "give both of `front_left` and `front_right`, or neither")
    _check_pair(frames, car.rear_left, car.rear_right, car.track, own)
    _check_pair(frames, car.steering_left, car.steering_right, car.track, own)
    length = frames.place(car.steering_left)[0] - frames.place(car.rear_left)[0]
    if abs(length - car.wheelbase) > _SLACK:
        own.add(
            "wheelbase", f"is {car.wheelbase:g} m, but '{car.steering_left}' is {length:.4g} m before the rear axle"
        )
    # the inner wheel turns further than the middle one
    inner = float(np.arctan2(car.wheelbase, car.wheelbase / np.tan(car.max_steering) - car.track / 2))
    for name in (car.steering_left, car.steering_right):
        joint = frames.joints[name]
        _turns(joint, own, endless=False)
        _points(frames, name, 2, "a steering joint turns about z of the base, so that positive is to the left", own)
        reach = min(-joint.lower, joint.upper)
        if reach < inner - 1e-6:
            words = f"'{name}' turns by {reach:.4g} rad, but as the inner wheel it must by {inner:.4g} rad"
            own.add("max_steering", f"{car.max_steering:g} rad in the middle is too much: {words}")


def _check_swerve(swerve: SwerveSpec, frames: _Frames, own: Issues) -> None:
    places = {module.position for module in swerve.modules}
    if len(places) < len(swerve.modules):
        own.add("modules", "two modules are in one place")
    for i, module in enumerate(swerve.modules):
        at = own.at("modules", i)
        _turns(frames.joints[module.steer], at, endless=True)
        _points(frames, module.steer, 2, "a steering joint turns about z of the base, positive to the left", at)
        for name in (module.steer, module.wheel):
            found = frames.place(name)[:2]
            if np.abs(found - np.array(module.position)).max() > _SLACK:
                x, y = module.position
                at.add("position", f"is ({x:g}, {y:g}) m, but '{name}' is at ({found[0]:.4g}, {found[1]:.4g}) m")


def _check_planar(planar: PlanarSpec, frames: _Frames, own: Issues) -> None:
    for number, name in enumerate((planar.x, planar.y)):
        if frames.joints[name].type is not JointType.PRISMATIC:
            own.add("xy"[number], f"'{name}' turns; a joint along {'xy'[number]} is prismatic")
        else:
            _points(frames, name, number, f"the joint moves along {'xy'[number]}", own)
    _turns(frames.joints[planar.yaw], own, endless=True)
    _points(frames, planar.yaw, 2, "the joint turns about z", own)
    order = [frames.joints[name].body for name in (planar.x, planar.y, planar.yaw)]
    if order != sorted(order):
        own.add("", f"the joints are to follow each other as x, y, yaw; '{planar.x}' is not the first of them")


def _turns(joint: Joint, own: Issues, *, endless: bool) -> None:
    if joint.type is not JointType.REVOLUTE:
        own.add("", f"'{joint.name}' slides; it must turn")
    elif endless and (isfinite(joint.lower) or isfinite(joint.upper)):
        own.add("", f"'{joint.name}' stops at [{joint.lower:g}, {joint.upper:g}] rad; it must turn without end")


def _points(frames: _Frames, name: str, axis: int, rule: str, own: Issues) -> None:
    found = frames.axis(name)
    if found[axis] < 1 - _AXIS:
        own.add("", f"'{name}' points along ({_triple(found)}) of the base; {rule}")


def _triple(values: Iterable[float]) -> str:
    return ", ".join(f"{value + 0.0:.3g}" for value in values)
