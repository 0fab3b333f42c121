"""`anysim render`: videos of recorded episodes, drawn from their recorded states."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from anysim.cli.options import AsJson, Overrides
from anysim_processes.options import Executor

if TYPE_CHECKING:
    from collections.abc import Sequence

    from anysim_film.filmer import Filmed
    from anysim_film.stage import FilmOrder


def render(
    directories: Annotated[
        list[Path],
        typer.Argument(metavar="DIR…", help="Trajectories, or runs with many of them; or one job of stills."),
    ],
    camera: Annotated[
        list[str] | None,
        typer.Option(
            "--camera",
            "-c",
            help="A camera of the recorded world, or one that -o adds; may be repeated. Default: those of the run.",
        ),
    ] = None,
    size: Annotated[tuple[int, int] | None, typer.Option(help="Width and height of the images [px].")] = None,
    fps: Annotated[float | None, typer.Option(min=0.01, help="Images per second of simulated time.")] = None,
    engine: Annotated[
        str | None, typer.Option("--engine", "-e", help="Another installed engine than that of the recording.")
    ] = None,
    override: Overrides = None,
    out: Annotated[
        Path | None, typer.Option(help="Directory of the videos; default: each trajectory's own, whose cameras lack.")
    ] = None,
    base: Annotated[
        Path | None, typer.Option(help="Folder of the recorded file, where its world has assets with relative paths.")
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option("--jobs", "-j", min=1, help="Processes that draw. [default: 1, or as many as --executor has]"),
    ] = None,
    executor: Executor = None,
    annotate: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help="Write annotations in place of videos: boxes_2d,normals, or {point_cloud: {stride: 2}}.",
        ),
    ] = None,
    source: Annotated[
        Literal["engine", "geometry"],
        typer.Option(help="What annotations see: the engine's drawing, or rays on the world's geometry."),
    ] = "engine",
    json: AsJson = False,
) -> None:
    """Draw recorded episodes from their recorded states; nothing is simulated.

    Without options it adds the videos that a trajectory lacks of its cameras, with the pixels that a live recording
    would have had. With other sizes, looks, lights, cameras or another engine they go into another directory, --out.
    What is there already is passed over, so the same command goes on where an interrupted one stopped.

    With --annotate it writes what cameras see as data, beside each trajectory (`anysim list annotators`). With a
    job in YAML it makes still images of a world that is drawn anew for each, with labels for detectors.

    Examples:
      anysim run pick_cube -k 64 -o record.cameras=[] --out runs/a && anysim render runs/a -c front
      anysim render runs/a --size 1280 720 -e sapien -o world.scenery.shadows=true --out films/a
      anysim render runs/a --annotate boxes_2d,normals,flow
      anysim render desk_images.yaml --out stills/desk
    """
    from anysim.cli.output import counting, print_json
    from anysim.record.names import find_trajectories
    from anysim_film.filmer import film_all, film_targets
    from anysim_film.stage import FilmOrder

    if len(directories) == 1 and directories[0].suffix in (".yaml", ".yml"):
        from anysim.errors import AnysimError

        given = {"--camera": camera, "--size": size, "--fps": fps, "--base": base, "--annotate": annotate}
        given |= {"--source": source != "engine"}
        if told := [name for name, value in given.items() if value]:
            raise AnysimError(
                f"{', '.join(told)}: what a job of still images draws stands in {directories[0]}; leave it out, or "
                "change the file with -o"
            )
        _stills(directories[0], out, engine, override or (), jobs, executor, quiet=json)
        return
    order = FilmOrder(tuple(camera or ()), engine, tuple(override or ()), size, fps, base)
    work = film_targets(find_trajectories(directories), out)
    if annotate is not None:
        _annotate(work, order, annotate, source, jobs, executor, quiet=json)
        return
    films: list[Filmed] = []
    with counting("episodes", len(work), quiet=json) as show:
        for film in film_all(work, order, jobs, executor):
            films.append(film)
            show(_line(film), f"{sum(f.frames for f in films)} images")
    if json:
        films.sort(key=lambda film: film.trajectory)
        print_json(
            {
                "filmed": sum(bool(f.cameras) for f in films),
                "images": sum(f.frames for f in films),
                "trajectories": [_row(film) for film in films],
            }
        )
        return
    still = sorted({name for film in films for name in film.still})
    if still:
        typer.echo(f"not recorded, and standing where a reset puts them: {', '.join(still)}")
    versions = sorted({(f.recorded_with, f.engine) for f in films if f.engine and f.engine != f.recorded_with})
    for recorded, drawn in versions:
        typer.echo(f"recorded with {recorded}, drawn with {drawn}: not the pixels that a recording would have had")
    new = sum(bool(film.cameras) for film in films)
    typer.echo(f"{new} of {len(films)} episodes filmed, {sum(f.frames for f in films)} images; the others were there")


def _annotate(
    work: "Sequence[tuple[Path, Path | None]]",
    order: "FilmOrder",
    names: str,
    source: str,
    jobs: int | None,
    executor: str | None,
    *,
    quiet: bool,
) -> None:
    """Make annotations, which another distribution knows how to."""
    from anysim import registry
    from anysim.cli.output import counting, print_json

    make = registry.load("renderings", "annotations")
    done = list[Any]()
    with counting("episodes", len(work), quiet=quiet) as show:
        for one in make(work, order, names, source, jobs, executor):
            done.append(one)
            what = (
                f"{', '.join(one.made)} -> {one.directory}" if one.made else f"{', '.join(one.present)} there already"
            )
            show(f"{one.trajectory.name}: {what}", f"{sum(d.frames for d in done)} images")
    new, images = sum(bool(one.made) for one in done), sum(one.frames for one in done)
    if quiet:
        rows = [{key: _shown(value) for key, value in vars(one).items()} for one in done]
        print_json({"annotated": new, "images": images, "trajectories": rows})
    else:
        typer.echo(f"{new} of {len(done)} episodes annotated, {images} images; the others were there")


def _stills(
    job: Path,
    out: Path | None,
    engine: str | None,
    overrides: "Sequence[str]",
    jobs: int | None,
    executor: str | None,
    *,
    quiet: bool,
) -> None:
    """Make still images, which another distribution knows how to."""
    from anysim import registry
    from anysim.cli.output import counting, print_json

    steps = registry.load("renderings", "stills")(job, out, engine, overrides, jobs, executor)
    last = next(steps)
    with counting("images", last.of - last.done, quiet=quiet or last.done == last.of) as show:
        for last in steps:
            show(f"{last.done} of {last.of} images", "")
    if quiet:
        print_json(last._asdict())
    else:
        typer.echo(f"{last.new} images made, {last.done} of {last.of} there")


def _shown(value: object) -> object:
    return str(value) if isinstance(value, Path) else list(value) if isinstance(value, tuple) else value


def _line(film: "Filmed") -> str:
    name = film.trajectory.name
    if not film.cameras:
        return f"{name}: {', '.join(film.present)} there already"
    return f"{name}: {', '.join(film.cameras)}, {film.frames} images -> {film.directory}"


def _row(film: "Filmed") -> dict[str, object]:
    return {
        "trajectory": str(film.trajectory),
        "directory": str(film.directory),
        "cameras": list(film.cameras),
        "present": list(film.present),
        "images": film.frames,
        "engine": film.engine,
        "recorded_with": film.recorded_with,
        "still": list(film.still),
    }
