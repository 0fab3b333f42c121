"""Work of `anysim robot` on engines."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from anysim.assets.catalogue import CatalogueEntry
    from anysim_robots.qualify.result import Qualification
    from anysim_robots.qualify.run import Durations


def qualified(robot: str, engines: Sequence[str], durations: "Durations", quiet: bool = False) -> "list[Qualification]":
    """Qualify on each engine, each in a process of its own."""
    from anysim.cli.output import working_on
    from anysim_robots.qualify.apart import qualify_apart

    found: list[Qualification] = []
    for engine in engines:
        if quiet:
            one = qualify_apart(robot, engine, durations).found
        else:
            with working_on(f"qualifying {robot} on {engine}"):
                one = qualify_apart(robot, engine, durations).found
        if one is not None:
            found.append(one)
    return found


def draw(entry: "CatalogueEntry", engines: Sequence[str], target: Path) -> str:
    """A PNG of the robot as each engine draws it, side by side; engines that cannot are named on stderr."""
    from PIL import Image

    from anysim.cli.output import working_on
    from anysim.errors import AnysimError
    from anysim_robots.qualify.portrait import portrait

    images, refused = [], []
    for engine in engines:
        try:
            with working_on(f"drawing on {engine}"):
                images.append(portrait(entry, engine, (480, 480)))
        except AnysimError as error:
            refused.append(f"{engine} took no part: {error}")
    for words in refused:
        typer.echo(words, err=True)
    if not images:
        raise AnysimError("no engine drew a picture; see above")
    import numpy as np

    target.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.hstack(images)).save(target)
    return str(target)
