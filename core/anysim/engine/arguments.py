"""Checks of arguments, so that a backend's primitives can trust theirs. Every message says what was expected."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from anysim.conventions import Array
from anysim.engine.state import Snapshot
from anysim.errors import EngineError, SnapshotError, listing, suggest
from anysim.math import arrays
from anysim.model.world import BodyKind, World


def named(kind: str, name: object) -> str:
    """A name, as it is."""
    if isinstance(name, str):
        return name
    raise EngineError(f"a {kind} is given by its name, got {arrays.shown(name)}")


def indices(values: ArrayLike, size: int, kind: str) -> Array:
    """Unique int indices in [0, size) from a sequence, an int array or an int."""
    array = np.atleast_1d(arrays.array(f"{kind} indices", values, EngineError))
    if array.dtype.kind == "b" or (array.size and array.dtype.kind not in "iu"):
        raise EngineError(f"{kind} indices must be integers, got {array.dtype} (for a mask pass np.flatnonzero(mask))")
    array = array.astype(np.int64).reshape(-1)
    rising = array.size < 2 or bool((array[1:] > array[:-1]).all())  # as most do: then their ends are the extremes
    if array.size and (min(array[0], array[-1]) < 0 or max(array[0], array[-1]) >= size or not rising):
        bad = array[(array < 0) | (array >= size)]
        if bad.size:
            raise EngineError(f"{kind} index {int(bad[0])} is out of range; there are {size}")
    if not rising and len(set(array.tolist())) != len(array):
        raise EngineError(f"{kind} indices repeat: {array.tolist()}")
    return array


def rows(name: str, values: ArrayLike, shape: tuple[int | None, ...]) -> Array:
    """Finite float64 values of the shape (None matches any length); missing leading axes are broadcast."""
    array = arrays.numbers(name, values, EngineError)
    if None in shape:
        if array.ndim != len(shape) or any(s is not None and s != a for s, a in zip(shape, array.shape, strict=True)):
            raise EngineError(f"{name} must have shape {_spell(shape)}, got {array.shape}")
        target = array.shape
    else:
        target = tuple(s for s in shape if s is not None)
    try:
        full = array if array.shape == target else np.broadcast_to(array, target)
    except ValueError:
        raise EngineError(f"{name} must have shape {_spell(shape)}, got {array.shape}") from None
    if not np.isfinite(array).all():
        raise EngineError(f"{name} holds a value that is not finite")
    return full


def _spell(shape: tuple[int | None, ...]) -> str:
    return "(" + ", ".join("any" if s is None else str(s) for s in shape) + ")"


def poses(name: str, values: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Like rows; the quaternions must be unit within 1e-3 and are normalised."""
    array = rows(name, values, shape).copy()
    length = np.linalg.norm(array[..., 3:], axis=-1, keepdims=True)
    if array.size and np.abs(length - 1).max() > 1e-3:
        worst = float(length.flat[np.abs(length - 1).argmax()])
        raise EngineError(f"{name} holds a quaternion of length {worst:.3g}; xyzw of unit length expected")
    # already-unit quaternions keep their bits, so that writing back what was read changes nothing
    array[..., 3:] = np.where(np.abs(length - 1) < 1e-12, array[..., 3:], array[..., 3:] / length)
    return array


def roots_only(world: World, bodies: Array, with_twist: bool) -> None:
    """Links move by their joints; static bodies have no velocity."""
    for body in bodies:
        kind = world.bodies[body].kind
        if kind is BodyKind.LINK:
            raise EngineError(f"body '{world.bodies[body].name}' is moved by a joint; use set_joint_state()")
        if with_twist and kind is BodyKind.STATIC:
            raise EngineError(f"body '{world.bodies[body].name}' is fixed to the world and has no velocity")


def with_followers(
    world: World, joints: Array, position: Array | None, velocity: Array | None
) -> tuple[Array, Array | None, Array | None]:
    """Add the mimic joints whose leaders are written, at the values they must have, and those that follow these."""
    chosen = {int(j): column for column, j in enumerate(joints)}
    extra = [
        (i, chosen[j.mimic.joint], j.mimic)
        for i, j in enumerate(world.joints)
        if j.mimic is not None and j.mimic.joint in chosen and i not in chosen
    ]
    if not extra:
        return joints, position, velocity
    columns = [column for _, column, _ in extra]
    all_joints = np.concatenate([joints, [i for i, *_ in extra]])
    if velocity is not None:
        if position is None and any(mimic.curve for *_, mimic in extra):
            raise EngineError("a joint that follows another by a curve needs a position beside a velocity")
        place = np.zeros_like(velocity) if position is None else position
        rate = np.stack([np.broadcast_to(m.rate(place[:, c]), len(place)) for _, c, m in extra], axis=1)
        velocity = np.concatenate([velocity, velocity[:, columns] * rate], axis=1)
    if position is not None:
        position = np.concatenate([position, np.stack([m.position(position[:, c]) for _, c, m in extra], 1)], axis=1)
    return with_followers(world, all_joints, position, velocity)


def kept(engine: str, name: str, wanted: Array, got: Array) -> None:
    """What was read back equals what was written, to single precision.

    A vector or tensor counts as a whole: an engine that turns it into other axes rounds by a share of the largest part.
    """
    size = np.abs(wanted)
    if wanted.ndim > 2:
        size = size.max(axis=tuple(range(2, wanted.ndim)), keepdims=True)
    if not (np.abs(got - wanted) <= 1e-7 + 1e-5 * size).all():
        worst = np.unravel_index(np.abs(got - wanted).argmax(), wanted.shape)
        raise EngineError(
            f"{engine} did not keep {name}: wrote {wanted[worst]:.6g}, read back {got[worst]:.6g} "
            f"(env row {worst[0]}, index {worst[1]})"
        )


def same_stamp(snapshot: Snapshot, engine: str, version: str, world_hash: str, rows_wanted: int) -> None:
    """A snapshot fits this engine, its version and world."""
    for what, theirs, ours in (
        ("engine", snapshot.engine, engine),
        ("engine version", snapshot.engine_version, version),
        ("world", snapshot.world_hash, world_hash),
    ):
        if theirs != ours:
            raise SnapshotError(
                f"the snapshot was taken with {what} {theirs}, this is {ours}; nothing was changed. Take a new one, "
                f"replay its episode here from seed and actions, or carry a WorldState over"
            )
    if snapshot.num_envs != rows_wanted:
        raise SnapshotError(f"the snapshot holds {snapshot.num_envs} envs, {rows_wanted} were asked for; pass env_ids")


def validated_options(engine: str, model: Any, options: dict[str, Any]) -> Any:
    """Options by the engine's pydantic model, or an EngineError with what exists."""
    if model is None:
        if options:
            raise EngineError(f"{engine} takes no options, got {listing(options)}")
        return None
    fields = list(model.model_fields)
    unknown = [key for key in options if key not in fields]
    if unknown:
        raise EngineError(
            f"{engine} has no option '{unknown[0]}'{suggest(unknown[0], fields)} (options: {listing(fields)})"
        )
    try:
        return model.model_validate(options)
    except ValueError as error:
        raise EngineError(f"options of {engine}: {error}") from error
