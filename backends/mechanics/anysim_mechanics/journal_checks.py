"""Checks of journals and built values that come from a file: whatever they say is done to a scene."""

from collections.abc import Mapping

import numpy as np

from anysim.conventions import Array
from anysim.engine.control import MODES
from anysim.engine.parameters import PARAMETERS
from anysim.engine.snapshots.row_checks import damaged, refuse_parameters, refuse_range, refuse_rotations
from anysim.errors import SnapshotError
from anysim.model.world import BodyKind, World
from anysim_mechanics.journal import FORMAT, Op, entries

_BASE = {
    "mass": "body.mass",
    "com": "body.com",
    "inertia": "body.inertia",
    "geom_friction": "geom.friction",
    "geom_restitution": "geom.restitution",
    "joint_friction": "joint.friction",
    "armature": "joint.armature",
}
"""Parameters that a scene is built with."""
_BODY = {Op.POSE, Op.VELOCITY, Op.INERTIAL, Op.DAMPING}
_JOINT = {Op.DRY, Op.ARMATURE}


def refuse_pasts(data: Mapping[str, Array], world: World, steps: int) -> None:
    """Refuse rows from which a scene could not be built and played, or that would have it do what no run does.

    `steps` is how many physics steps a journal has at most.

    Raises:
        SnapshotError: of another format, or damaged.
    """
    if (other := data["journal_format"][data["journal_format"] != FORMAT]).size:
        raise SnapshotError(
            f"the snapshot's journal has format {other[0]}, this anysim-mechanics reads {FORMAT}; nothing was changed. "
            f"Take a new one, replay its episode here from seed and actions, or carry a WorldState over"
        )
    envs = len(data["length"])
    values = {name: data[f"base.{short}"] for short, name in _BASE.items()}
    wanted = {name.removeprefix("wanted."): rows for name, rows in data.items() if name.startswith("wanted.")}
    for rows in (values, wanted):
        refuse_parameters(world, PARAMETERS, rows, envs)
    refuse_range("base.damping", data["base.damping"], 0.0, np.inf)
    refuse_range("length", data["length"], 0, data["journal"].shape[1])
    sizes = _sizes(world)
    for row, length in zip(data["journal"], data["length"], strict=True):
        done = 0
        for op, numbers in entries(row[: int(length)]):
            _refuse_entry(op, numbers, sizes.get(op), world)
            done += int(numbers[0]) if op is Op.STEP else 0
            if done > steps:
                raise damaged(f"a journal says {done} steps, and no run has more than {steps} (options.rebase_steps)")


def _sizes(world: World) -> Mapping[Op, int]:
    drives, joints = len(world.actuators), len(world.joints)
    gains, both = 3 * drives + joints, 2 + 2 * joints
    return {
        Op.STEP: 1, Op.CONTROL: 4 * drives, Op.GAINS: gains, Op.JOINTS: both, Op.POSE: 8, Op.VELOCITY: 7,
        Op.INERTIAL: 11, Op.DRY: 2, Op.ARMATURE: 2, Op.BASE: 0, Op.DAMPING: 3,
    }  # fmt: skip


def _refuse_entry(op: Op, numbers: Array, size: int | None, world: World) -> None:
    what = f"the journal's entry {op.name}"
    if len(numbers) != size if size is not None else len(numbers) % 7:
        raise damaged(f"{what} has {len(numbers)} numbers")
    # where nothing limits an effort, the limit is infinite
    if np.isnan(numbers).any() or not (op is Op.GAINS or np.isfinite(numbers).all()):
        raise damaged(f"{what} holds a value that is not finite")
    if op in _BODY or op in _JOINT or op is Op.WRENCH:
        things = len(world.joints if op in _JOINT else world.bodies)
        index = numbers[::7] if op is Op.WRENCH else numbers[:1]
        if not ((index == np.floor(index)) & (index >= 0) & (index < things)).all():
            raise damaged(f"{what} is of number {index[0]:g}, and there are {things}")
    if op is Op.STEP:
        refuse_range(what, numbers, 1, np.inf)
    elif op is Op.CONTROL:
        refuse_range(f"{what} (modes)", numbers.reshape(4, -1)[3], 0, len(MODES) - 1)
    elif op in (Op.GAINS, Op.DAMPING, *_JOINT):
        refuse_range(what, numbers, 0.0, np.inf)
    elif op is Op.POSE:
        refuse_rotations(what, numbers[4:])
    elif op is Op.INERTIAL:
        rows = np.zeros((1, len(world.bodies), 6))
        rows[0, int(numbers[0])] = numbers[5:]
        refuse_parameters(world, PARAMETERS, {"body.inertia": rows}, 1)
        refuse_range(what, numbers[1:2], 0.0, np.inf)
    if op in (Op.POSE, Op.VELOCITY) and world.bodies[int(numbers[0])].kind is BodyKind.LINK:
        raise damaged(f"{what} moves a link, which only joints do")
