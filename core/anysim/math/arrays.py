"""Arrays and whole numbers from what a caller gives, or one sentence that says what was expected."""

from numbers import Real

import numpy as np

from anysim.conventions import Array
from anysim.errors import AnysimError

SEEDS = 2**64
"""Seeds are whole numbers from 0 to below this."""


def array(name: str, values: object, error: type[AnysimError]) -> Array:
    """What was given as an array of whatever it holds.

    Raises:
        AnysimError: of type `error`; it is ragged, masked, or nothing that can become an array.
    """
    if isinstance(values, np.ma.MaskedArray):
        raise error(f"{name} is a masked array; fill what is masked, as with .filled(0.0)")
    try:
        return np.asarray(values)
    except (ValueError, TypeError, OverflowError, RecursionError, RuntimeError) as reason:
        ragged = "inhomogeneous" in str(reason)
        what = "has rows of different lengths" if ragged else f"cannot become an array ({reason})"
        raise error(f"{name} {what}; rows of numbers of equal length expected") from None


def numbers(name: str, values: object, error: type[AnysimError]) -> Array:
    """Real numbers as float64; an array of floats is returned as it is.

    Raises:
        AnysimError: of type `error`; it is ragged or masked, or holds text, dates, complex numbers or other objects.
    """
    if type(values) is np.ndarray and values.dtype.kind == "f":
        return values.astype(np.float64, copy=False)
    found = array(name, values, error)
    if found.dtype.kind == "O" and all(isinstance(value, Real) for value in found.flat):
        try:
            return found.astype(np.float64)
        except OverflowError:
            raise error(f"{name} holds a whole number that is too large for a float") from None
    if found.dtype.kind not in "fiub":
        holds = type(next(found.flat, None)).__name__ if found.dtype.kind == "O" else str(found.dtype)
        raise error(f"{name} must hold real numbers, got values of type {holds}")
    return found.astype(np.float64)


def whole(name: str, value: object, error: type[AnysimError], least: int = 0, below: int = SEEDS) -> int:
    """A whole number from `least` to below `below`.

    Raises:
        AnysimError: of type `error`; it is none, or outside.
    """
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | np.integer):
        raise error(f"{name} must be a whole number, got {shown(value)}")
    if not least <= value < below:
        raise error(f"{name} must be from {least} to {_spelled(below - 1)}, got {shown(value)}")
    return int(value)


def wholes(name: str, values: object, count: int, error: type[AnysimError]) -> list[int]:
    """`count` whole numbers, each from 0 to below 2^64.

    Raises:
        AnysimError: of type `error`; they are no sequence, of another length, or one is no such number.
    """
    listed = values.tolist() if isinstance(values, np.ndarray) else values
    if not isinstance(listed, list | tuple | range):
        raise error(f"{name} must be a list of {count} whole numbers, one for each env, got {shown(values)}")
    if len(listed) != count:
        raise error(f"{name} must be a list of {count} whole numbers, one for each env, got {len(listed)}")
    return [whole(name, value, error) for value in listed]


def chosen(mask: Array | None, count: int, error: type[AnysimError]) -> Array:
    """(n,) the envs of `count` where a mask (N,) bool is true; all of them where there is none."""
    if mask is None:
        return np.arange(count)
    mask = array("mask", mask, error)
    if mask.dtype != bool or mask.shape != (count,):
        raise error(f"mask must be a bool array of shape ({count},), got {mask.dtype} {mask.shape}")
    return np.flatnonzero(mask)


def _spelled(number: int) -> str:
    return "2^64 - 1" if number == SEEDS - 1 else f"{number:,}"


def shown(value: object) -> str:
    """A value in a sentence: numbers and short texts as they are, else its type."""
    if isinstance(value, int | np.integer) and abs(int(value)) >= 10**30:
        return f"a number of {int(value).bit_length()} bits"
    if isinstance(value, str | bytes | int | float | np.generic) or value is None:
        text = repr(value)
        return text if len(text) <= 60 else f"{text[:59]}…"
    return f"a {type(value).__name__}"
