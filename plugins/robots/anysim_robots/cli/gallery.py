"""`anysim gallery`: every robot on every engine, drawn and qualified."""

from pathlib import Path
from typing import Annotated

import typer


def gallery(
    out: Annotated[Path, typer.Option(help="The folder for the page, the contact sheets and the pictures.")] = Path(
        "runs/gallery"
    ),
    engines: Annotated[
        str | None, typer.Option("--engines", "-e", help="Names separated by commas; default all that run here.")
    ] = None,
    robots: Annotated[
        str | None, typer.Option("--robots", "-r", help="Names separated by commas, or categories; default all.")
    ] = None,
    hold: Annotated[float, typer.Option(min=0.02, help="Simulated time to hold still [s].")] = 5.0,
    random: Annotated[float, typer.Option(min=0.02, help="Simulated time of random actions [s].")] = 10.0,
    limit: Annotated[float, typer.Option(min=1.0, help="Wall-clock time for one robot on one engine [s].")] = 180.0,
    again: Annotated[bool, typer.Option("--again", help="Measure again what is there already.")] = False,
    progress: Annotated[
        bool, typer.Option("--progress/--no-progress", help="A bar on a terminal, a line each in a pipe.")
    ] = True,
) -> None:
    """Draw and qualify every robot of the catalogue on every engine; write a page and contact sheets.

    Each robot and engine has a process of its own and a time limit: a crash is a row. It goes on where it was stopped;
    what has been measured of an unchanged entry is kept in OUT/robots.json.

    Examples:
      anysim gallery
      anysim gallery --robots arm,unitree_go1 --engines mujoco,sapien --out /tmp/gallery
      anysim gallery --hold 1 --random 0.5
    """
    from anysim.cli.output import counting
    from anysim_robots.gallery.page import contact_sheets, page
    from anysim_robots.gallery.store import due, estimate, measure, read
    from anysim_robots.qualify.run import Durations
    from anysim_robots.qualify.stage import engines as able

    names = _robots(robots)
    chosen = [name.strip() for name in engines.split(",")] if engines else able()
    durations, file = Durations(hold, random), out / "robots.json"
    stored = read(file)
    count = len(names) * len(chosen) if again else len(due(stored, names, chosen, durations))
    typer.echo(f"{count} to measure, about {estimate(stored, count) / 60:.0f} minutes", err=True)
    with counting("qualifying", count, quiet=not progress) as tell:
        stored = measure(file, names, chosen, durations, pictures=out / "pictures", limit=limit, again=again, tell=tell)
    stored = {**stored, "robots": {name: stored["robots"][name] for name in names if name in stored["robots"]}}
    target = out / "index.html"
    target.write_text(page(stored, chosen, out), encoding="utf-8")
    for sheet in contact_sheets(stored, chosen, out):
        typer.echo(str(sheet))
    typer.echo(str(target))


def _robots(text: str | None) -> list[str]:
    """Names of the catalogue, or all of a category."""
    from typing import get_args

    from anysim import registry
    from anysim.assets.catalogue import load_robot
    from anysim.errors import AnysimError, NameLookupError, listing, suggest
    from anysim_schemas.robot_model import Category

    known = registry.names("robots")
    if text is None:
        return known
    categories: dict[str, list[str]] = {str(c): [] for c in get_args(Category)}
    for name in known:
        try:
            categories[load_robot(name).spec.category].append(name)
        except AnysimError:
            continue  # it is measured under its own name, where that fails
    chosen: list[str] = []
    for word in (part.strip() for part in text.split(",")):
        if word not in known and word not in categories:
            raise NameLookupError(
                f"there is no robot or category '{word}'{suggest(word, [*known, *categories])} (robots: "
                f"{listing(known, 60)}; categories: {listing(categories, 10)})"
            )
        chosen += [word] if word in known else categories[word]
    return list(dict.fromkeys(chosen))
