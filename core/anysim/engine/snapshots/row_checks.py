"""Checks of the rows of a snapshot, which may come from a file of any origin."""

from collections.abc import Collection, Generator, Mapping
from contextlib import contextmanager

import numpy as np

from anysim.conventions import Array
from anysim.engine.parameters import PARAMETERS, check_values, count
from anysim.errors import EngineError, SnapshotError, listing
from anysim.kinematics.inertia import check_physical, principal
from anysim.model.world import World

LARGEST = float(np.finfo(np.float64).max)
SENSIBLE = 1e30
"""Beyond this, in SI units, observations and rewards have no single-precision numbers any more."""


def damaged(found: str) -> SnapshotError:
    """The error of a snapshot that cannot be restored, before anything was changed."""
    return SnapshotError(
        f"the snapshot is damaged or not of this env: {found}; nothing was changed. Take a new snapshot, or replay the "
        f"episode from its seed and actions"
    )


@contextmanager
def told() -> Generator[None, None, None]:
    """Have a check of arguments say that it is the snapshot that they come from."""
    try:
        yield
    except EngineError as error:
        raise damaged(str(error)) from error


def mapping_of_arrays(owner: str, data: object) -> Mapping[str, Array]:
    """The data, if it maps words to arrays.

    Raises:
        SnapshotError: it is something else, as a forged file may hold.
    """
    if not isinstance(data, Mapping):
        raise damaged(f"{owner} should map names to arrays, and is a {type(data).__name__}")
    for name, rows in data.items():
        if not isinstance(name, str) or not isinstance(rows, np.ndarray):
            raise damaged(f"'{name}' of {owner} should be an array, and is a {type(rows).__name__}")
    return data


def refuse_other_forms(
    owner: str,
    data: Mapping[str, Array],
    like: Mapping[str, Array],
    envs: int,
    *,
    optional: Collection[str] = (),
    ragged: Collection[str] = (),
    faulty: Array | None = None,
    most: float = LARGEST,
) -> None:
    """Refuse rows of other names, types, lengths or shapes than those of `like`, and values that are not finite.

    Args:
        optional: names of `like` that may be missing.
        ragged: names of two axes whose rows may have any length; the engine itself looks at what is in them.
        faulty: (envs,) bool, the rows of envs that were given up, in which anything may stand.
        most: the largest magnitude.

    Raises:
        SnapshotError: what differs first.
    """
    missing, odd = like.keys() - data.keys() - set(optional), data.keys() - like.keys()
    if missing:
        raise damaged(f"{owner}: '{sorted(missing)[0]}' is missing")
    if odd:
        raise damaged(f"{owner} has {listing(sorted(odd))}, which this env does not know (it has {listing(like)})")
    for name, rows in data.items():
        model = like[name]
        shape = (envs, *model.shape[1:])
        fits = rows.shape[:1] == shape[:1] and rows.ndim == 2 if name in ragged else rows.shape == shape
        if rows.dtype != model.dtype or not fits:
            raise damaged(f"'{name}' of {owner} holds {rows.dtype} {rows.shape}, not {model.dtype} {shape}")
        if rows.dtype.kind == "f" and rows.size and name not in ragged:
            bad = ~(np.abs(rows.reshape(envs, -1)) <= most).all(axis=1)
            if faulty is not None:
                bad &= ~faulty
            if bad.any():
                found = f"holds a value that is not finite, or larger than {most:g}, in row {int(np.argmax(bad))}"
                raise damaged(f"'{name}' of {owner} {found}")


def refuse_range(name: str, rows: Array, low: float, high: float) -> None:
    """Refuse values outside of [low, high]."""
    wrong = rows[(rows < low) | (rows > high)]
    if wrong.size:
        raise damaged(f"'{name}' is {wrong.flat[0]:g}, which is not between {low:g} and {high:g}")


def refuse_rotations(name: str, quaternions: Array) -> None:
    """Refuse quaternions (..., 4) that are not of unit length within 1e-3."""
    length = np.linalg.norm(quaternions, axis=-1)
    wrong = length[~(np.abs(length - 1.0) <= 1e-3)]
    if wrong.size:
        raise damaged(f"'{name}' holds a quaternion of length {wrong.flat[0]:.3g}")


def refuse_parameters(world: World, known: Collection[str], rows: Mapping[str, Array], envs: int) -> None:
    """Refuse parameters that the engine cannot change, and values that they cannot have.

    Raises:
        SnapshotError: which one, and why.
    """
    for name, values in rows.items():
        if name not in PARAMETERS or name not in known:
            raise damaged(f"it changes the parameter '{name}', which this engine cannot")
        parameter = PARAMETERS[name]
        things = count(parameter, world)
        like = {name: np.zeros((1, things, *parameter.shape))}
        # where nothing limits an effort, the limit is infinite
        anything = np.full(envs, name == "actuator.effort_limit")
        refuse_other_forms("the parameters", {name: values}, like, envs, faulty=anything)
        if np.isnan(values).any():
            raise damaged(f"'{name}' holds a value that is no number")
        with told():
            check_values(parameter, world, values, np.arange(things))
            if name == "body.inertia":
                _check_inertia(world, values)


def _check_inertia(world: World, values: Array) -> None:
    for row in values:
        for body, tensor in zip(world.bodies, row, strict=True):
            if tensor.any():
                check_physical(body.name, principal(tensor).moments)
