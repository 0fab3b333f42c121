"""Steps of an env: in a run, and in the same way when its journal is played again."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from anysim.conventions import Array
from anysim.engine.control import Control
from anysim_mechanics.journal import FORMAT, Op, entries
from anysim_sapien.drives import Drives, drives_of
from anysim_sapien.momentum import Momentum
from anysim_sapien.recipe import Recipe, Values
from anysim_sapien.scene import EnvScene


def advance(scene: EnvScene, drives: Drives, momentum: Momentum, row: int, pushes: Array | None, n_steps: int) -> None:
    """Step a scene under the commands in a row of the drives, and note its momentum in that row.

    `pushes` (K, 7) are bodies and the wrenches on them, in each of the steps.
    """
    system, driven, journal = scene.system, bool(scene.joints), scene.journal
    if driven:
        drives.record(row, journal)
        drives.begin(row, scene)
    pushed: list[tuple[Any, Array, Array]] = []
    if pushes is not None and len(pushes):
        journal.record(Op.WRENCH, pushes.tobytes())
        pushed = [(scene.bodies[int(push[0])], push[1:4], push[4:]) for push in pushes]
    for number in range(n_steps):
        if driven:
            drives.substep(row, scene)
        if number == n_steps - 1:
            momentum.before(scene)
        for component, force, torque in pushed:
            component.add_force_torque(force, torque)
        system.step()
    scene.stepped(n_steps)
    momentum.after(row, scene, pushes)
    if driven:
        drives.note(row, partial(scene.packing.joints, scene.packed()))
    if pushed:
        journal.flush()


def replay(scene: EnvScene, recipe: Recipe, rows: Array) -> tuple[Drives, Momentum]:
    """Do to a scene as built what a journal says; the scene's own says the same afterwards.

    Returns the drives of one env that moved it, and the momentum of its last substep.
    """
    drives, momentum = drives_of(recipe.world, 1), Momentum(recipe.common, 1)
    pushes: Array | None = None
    for op, values in entries(rows):
        match op:
            case Op.STEP:
                advance(scene, drives, momentum, 0, pushes, int(values[0]))
                pushes = None
            case Op.WRENCH:
                pushes = values.reshape(-1, 7)
            case Op.CONTROL:
                drives.apply(Control(*values.reshape(4, 1, -1)))
            case Op.GAINS:
                drives.set_gains(0, values)
            case Op.JOINTS:
                position, velocity = values[2:].reshape(2, -1)
                scene.place_joints(position if values[0] else None, velocity if values[1] else None)
            case Op.POSE:
                scene.place_body(int(values[0]), values[1:])
            case Op.VELOCITY:
                scene.push_body(int(values[0]), values[1:4], values[4:])
            case Op.INERTIAL:
                scene.set_inertial(int(values[0]), float(values[1]), values[2:5], values[5:])
            case Op.DRY:
                scene.set_dry(int(values[0]), float(values[1]))
            case Op.ARMATURE:
                scene.set_armature(int(values[0]), float(values[1]))
            case Op.DAMPING:
                scene.set_damping(int(values[0]), values[1:])
            case Op.BASE:
                scene.journal.base()
    return drives, momentum


def past_of(scene: EnvScene) -> dict[str, ArrayLike]:
    """What a scene was built with, and its journal (L,), as long as `length` says where zeros follow."""
    journal = scene.journal.rows()
    past: dict[str, ArrayLike] = {f"base.{name}": part for name, part in scene.values._asdict().items()}
    return past | {"journal": journal, "length": len(journal), "journal_format": FORMAT}


def relive(recipe: Recipe, past: Mapping[str, Array]) -> tuple[EnvScene, Drives, Momentum]:
    """The scene of which `past_of` says this, in the same state to the bit, with its drives and its momentum."""
    scene = EnvScene(recipe, Values(*(past[f"base.{name}"] for name in Values._fields)))
    return scene, *replay(scene, recipe, past["journal"][: int(past["length"])])


def wrenches(rows: Array, fixed: Array) -> Array:
    """The (K, 7) bodies and wrenches, of an env's (B, 6), that act on something that can move."""
    pushed = np.flatnonzero(rows.any(axis=1) & ~fixed)
    return np.concatenate([pushed[:, None].astype(float), rows[pushed]], axis=1)
