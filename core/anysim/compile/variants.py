"""Variants of a declared object: its sources, its sizes, its number, and how each of them is drawn.

Geometry is fixed at build, so each source in each size is an entity of its own, and a draw decides which is there.
"""

import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from fnmatch import fnmatchcase
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

from anysim.assets.uri import locate_folder
from anysim.errors import AssetError, listing
from anysim.randomization.distributions import quantile
from anysim_schemas.limits import FOLDER_ENTRIES
from anysim_schemas.object_source import PROCEDURAL, SHAPES, Count, SourceChoice, SourceFolder, SourceSpec, most
from anysim_schemas.objects import ObjectSpec
from anysim_schemas.values import Choice, Distribution

INSTANCER = "rigid_instancer"


class Options(NamedTuple):
    """All that something can be, and how it is drawn.

    Attributes:
        values: what it can be.
        nominal: the index of what it is before anything is drawn.
        drawn: the choice to draw from; None where there is nothing to draw.
    """

    values: tuple[Any, ...]
    nominal: int = 0
    drawn: Choice[Any] | None = None


def options(values: Sequence[Any], middle: int = 0, like: Any = None) -> Options:
    """The options of a drawn value that can be `values`, `values[middle]` nominally, and is gated and shared as `like`.

    Where `like` says what the other episodes have, that is one more of them.
    """
    listed, index = tuple(values), middle
    extra = getattr(like, "otherwise", None)
    every = listed
    if extra is not None:
        every = listed if extra in listed else (*listed, extra)
        index = every.index(extra)
    if len(every) == 1:
        return Options(every)
    ratio = getattr(like, "ratio", 1.0)
    drawn = Choice[Any](
        choice=listed,
        weights=getattr(like, "weights", None),
        ratio=ratio,
        shared=getattr(like, "shared", None),
        otherwise=every[index] if ratio < 1.0 else None,
    )
    return Options(every, index, drawn)


def sizes(spec: ObjectSpec) -> Options:
    """The scales that an object is made in: of a distribution the middles of `sizes` equally likely parts."""
    value = spec.scale
    if not isinstance(value, Distribution):
        return Options((value,))
    if isinstance(value, Choice):
        return options(value.choice, like=value)
    shares = [(k + 0.5) / spec.sizes for k in range(spec.sizes)]
    return options([quantile(value, share) for share in shares], spec.sizes // 2, value)


def counts(count: Count) -> Options:
    """How many instances there can be."""
    if isinstance(count, int):
        return Options((count,))
    if isinstance(count, Choice):
        return options(count.choice, like=count)
    low, high = count.range
    return options(range(low, high + 1), (high - low) // 2, count)


def instances(name: str, spec: ObjectSpec) -> tuple[str, ...]:
    """The names of the logical objects that a declaration stands for: cube_0, cube_1, … where it has a count."""
    if spec.count is None or spec.family == INSTANCER:
        return (name,)
    return tuple(f"{name}_{i}" for i in range(most(spec.count)))


class KeyedSource(NamedTuple):
    """One of the sources of an object, and its dotted key below the object's."""

    source: SourceSpec
    key: str


def sources(spec: ObjectSpec, base: Path | None) -> tuple[list[KeyedSource], int]:
    """The sources of an object, and the index of the nominal one; a folder's are its files by name.

    Raises:
        AssetError: there is no such folder, or nothing in it that the pattern fits.
    """
    source = spec.source
    if isinstance(source, SourceFolder):
        return [KeyedSource(one, "source") for one in _files(source, base)], 0
    if not isinstance(source, SourceChoice):
        return [KeyedSource(source, "source")], 0
    found = [KeyedSource(one, f"source.choice.{i}") for i, one in enumerate(source.choice)]
    if source.otherwise is None:
        return found, 0
    if source.otherwise in source.choice:
        return found, source.choice.index(source.otherwise)
    return [*found, KeyedSource(source.otherwise, "source.otherwise")], len(found)


def _files(spec: SourceFolder, base: Path | None) -> list[SourceSpec]:
    folder = locate_folder(spec.folder, base=base)
    found = dict.fromkeys(_fitting(folder.path, Path(spec.pattern).parts, count(1), spec.folder))
    ordered = sorted(found, key=lambda path: path.relative_to(folder.path).as_posix())
    files = [path for path in ordered if path.is_file() and not path.name.startswith(".")]
    for path in files:
        if not path.resolve().is_relative_to(folder.root):
            raise AssetError(f"folder '{spec.folder}' leaves its root {folder.root}: {path.name} is {path.resolve()}")
    if not files:
        there = sorted(path.name for path in folder.path.iterdir())
        raise AssetError(
            f"folder '{spec.folder}' has no file that fits '{spec.pattern}' (it has: {listing(there, 8) or 'nothing'})"
        )
    return [
        SourceSpec.model_validate(
            SourceSpec.from_text(f"{spec.folder.rstrip('/')}/{path.relative_to(folder.path).as_posix()}")
            | {"scale": spec.scale, "collision": spec.collision}
        )
        for path in files
    ]


def _fitting(folder: Path, parts: Sequence[str], seen: Iterator[int], where: str) -> Iterator[Path]:
    """What is below a folder and fits a pattern, by its parts; `**` stands for any number of folders.

    Raises:
        AssetError: more has to be looked at than a folder of sources may hold.
    """
    if not parts:
        yield folder
        return
    first, rest = parts[0], parts[1:]
    if first == "**":
        yield from _fitting(folder, rest, seen, where)
    with suppress(PermissionError), os.scandir(folder) as entries:
        for entry in entries:
            if FOLDER_ENTRIES.exceeded(next(seen)):
                raise AssetError(f"folder '{where}': {FOLDER_ENTRIES.sentence()}")
            path = folder / entry.name
            if first == "**" and entry.is_dir(follow_symlinks=False):
                yield from _fitting(path, parts, seen, where)
            elif first != "**" and fnmatchcase(entry.name, first) and (not rest or entry.is_dir()):
                yield from _fitting(path, rest, seen, where)


def source_text(source: SourceSpec) -> str:
    """A source in few words: its URI, or `box 0.1 0.1 0.2`."""
    if source.procedural is not None:
        text = ", ".join([PROCEDURAL + source.procedural, *(f"{k} {v}" for k, v in source.params.items())])
    elif source.mesh is not None or source.asset is not None:
        text = source.mesh or source.asset or ""
    else:
        kind, value = next((kind, value) for kind in SHAPES if (value := getattr(source, kind)) is not None)
        parts = value if isinstance(value, tuple) else (value,)
        text = " ".join([kind, *(f"{part:g}" if isinstance(part, float) else str(part) for part in parts)])
    return text if source.scale == 1.0 else f"{text}, scale {source.scale:g}"


def drawn_sources(spec: ObjectSpec, texts: Sequence[str]) -> Options:
    """How the sources of an object are drawn, which are called `texts`, in the order of `sources`."""
    source, named = spec.source, _told_apart(texts)
    if len(named) == 1:
        return Options(named)
    if not isinstance(source, SourceChoice):
        return options(named, like=source)
    first, listed = 0, len(source.choice)
    if source.otherwise is not None:
        first = source.choice.index(source.otherwise) if source.otherwise in source.choice else listed
    drawn = Choice[Any](
        choice=named[:listed],
        weights=source.weights,
        ratio=source.ratio,
        shared=source.shared,
        otherwise=named[first] if source.ratio < 1.0 else None,
    )
    return Options(named, first, drawn)


def _told_apart(texts: Sequence[str]) -> tuple[str, ...]:
    """The texts, those that come again with their number."""
    return tuple(
        text if text not in texts[:k] else f"{text} ({texts[: k + 1].count(text)})" for k, text in enumerate(texts)
    )
