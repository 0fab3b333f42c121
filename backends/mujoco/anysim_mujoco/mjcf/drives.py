"""The drives that an MJCF file declares, as neutral ones."""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from math import inf
from typing import Any

import mujoco
import numpy as np

from anysim.assets.model import ActuatorHint, mode_of
from anysim.model.world import ControlMode
from anysim_mujoco.mjcf.couplings import Couplings


def drive_hint(
    model: Any,
    a: int,
    number: Mapping[int, int],
    unit: Callable[[int], float],
    couplings: Couplings,
    taken: Collection[int],
) -> tuple[ActuatorHint | None, str]:
    """The neutral drive that acts like MuJoCo actuator `a`, or None and why there is none.

    `number` maps MuJoCo joints to neutral ones; `unit` gives what lengths along a joint are scaled with. With a gear g
    the actuator's length is g q and its force acts g-fold, so gains grow with its square. The coefficients of a fixed
    tendon are gears as well: its drive is called by the first joint that no drive has yet (`taken` have), and the
    others are its shares.
    """
    joint_drives = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    joint, gear = int(model.actuator_trnid[a, 0]), float(model.actuator_gear[a, 0])
    others: list[tuple[int, float]] = []
    if int(model.actuator_trntype[a]) == int(mujoco.mjtTrn.mjTRN_TENDON):
        joints, coefficients = couplings.path(joint)
        if not joints:
            return None, "pulls at a spatial tendon"
        pairs = [(j, c) for j, c in zip(joints, coefficients, strict=True) if c]
        free = [i for i, (j, _) in enumerate(pairs) if number[j] not in taken]
        if not free:
            return None, "pulls at a tendon whose joints have drives of their own already"
        joint, ratio = pairs.pop(free[0])
        gear *= ratio
        others = [(number[j], c / ratio * unit(joint) / unit(j)) for j, c in pairs]
    elif int(model.actuator_trntype[a]) not in joint_drives or joint not in number:
        return None, "does not drive a single hinge or slide, nor a fixed tendon"
    if (
        model.actuator_dyntype[a] != mujoco.mjtDyn.mjDYN_NONE
        or model.actuator_gaintype[a] != mujoco.mjtGain.mjGAIN_FIXED
    ):
        return None, "has dynamics or a gain of its own; the neutral drive is a proportional-derivative one"
    gain = float(model.actuator_gainprm[a, 0])
    if gear == 0.0:
        return None, "has a gear of 0: it moves nothing"
    affine = model.actuator_biastype[a] == mujoco.mjtBias.mjBIAS_AFFINE
    _, stiffness, damping = (-float(v) for v in model.actuator_biasprm[a, :3]) if affine else (0.0, 0.0, 0.0)
    mode = mode_of(gain, stiffness, damping)
    if mode is None:
        return None, "has a feedback that is no position or velocity error"
    limits = [inf]
    if model.actuator_forcelimited[a]:
        limits.append(float(np.abs(model.actuator_forcerange[a]).max() * abs(gear)))
    if mode is ControlMode.EFFORT and model.actuator_ctrllimited[a]:
        limits.append(float(np.abs(model.actuator_ctrlrange[a]).max() * abs(gear * gain)))
    if model.jnt_actfrclimited[joint] and not others:
        limits.append(float(np.abs(model.jnt_actfrcrange[joint]).max()))
    factor = gear * gear / unit(joint)
    return ActuatorHint(number[joint], mode, stiffness * factor, damping * factor, min(limits), tuple(others)), ""


def left_out(model: Any, a: int, hint: ActuatorHint) -> Iterator[str]:
    """What MuJoCo actuator `a` has and its neutral drive `hint` does not, in words; values are the file's.

    A constant bias is a force before the gear. The range of a motor's control is its effort limit, that of a position
    drive narrows its targets beside the range (gear times position) of its joint.
    """
    constant = float(model.actuator_biasprm[a, 0])
    if constant and model.actuator_biastype[a] == mujoco.mjtBias.mjBIAS_AFFINE:
        yield f"adds a constant force of {constant:g}, which is left out"
    if hint.mode is ControlMode.EFFORT or not model.actuator_ctrllimited[a]:
        return
    joint, given = int(model.actuator_trnid[a, 0]), model.actuator_ctrlrange[a]
    if int(model.actuator_trntype[a]) == int(mujoco.mjtTrn.mjTRN_TENDON):
        yield f"has the ctrlrange [{given[0]:g}, {given[1]:g}], which is left out as limits of a target"
        return
    reach = np.sort(model.jnt_range[joint] * model.actuator_gear[a, 0])
    if hint.mode is ControlMode.POSITION and model.jnt_limited[joint] and np.allclose(given, reach, atol=1e-6):
        return
    kind = "position: those of its joint hold" if hint.mode is ControlMode.POSITION else "velocity"
    yield f"has the ctrlrange [{given[0]:g}, {given[1]:g}], which is left out as limits of a target {kind}"


def shared(hints: Iterable[ActuatorHint]) -> list[int]:
    """The joints that several drives have."""
    return [joint for joint, count in Counter(hint.joint for hint in hints).items() if count > 1]
