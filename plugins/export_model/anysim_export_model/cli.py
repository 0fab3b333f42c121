"""`anysim export-model`: robots, objects and worlds as files of other programs."""

from pathlib import Path
from typing import Annotated

import typer

from anysim.cli.options import AsJson, Overrides


def export_model(
    what: Annotated[
        str,
        typer.Argument(
            metavar="WORLD|ROBOT|FILE",
            help="A robot or a task by name, the YAML file of a world or a robot, or a model file.",
        ),
    ],
    to: Annotated[str, typer.Option("--to", help="The format: urdf, mjcf, or that of an installed writer, as usd.")],
    out: Annotated[
        Path | None, typer.Option("--out", help="The folder of the files; default runs/models/NAME-FORMAT.")
    ] = None,
    entity: Annotated[
        list[str] | None, typer.Option("--entity", help="One of the world's entities; may be repeated. Default: all.")
    ] = None,
    override: Overrides = None,
    force: Annotated[bool, typer.Option("--force", help="Write into a folder that is not empty.")] = False,
    json: AsJson = False,
) -> None:
    """Write a robot, an object or a world as URDF, MJCF or USD files, with their meshes beside them.

    MJCF and USD take a whole world: bodies, drives, lights, cameras, ground. A URDF is one tree, so that each entity of
    a world gets a file, and an SRDF beside it for its groups, its home and the pairs that never collide. What the
    format cannot hold is told, line by line.

    Examples:
      anysim export-model franka_panda --to urdf
      anysim export-model pick_cube --to mjcf --out models/pick
      anysim export-model my_arm.xml --to urdf --out models/my_arm
    """
    from anysim.cli.output import print_json
    from anysim.errors import AnysimError
    from anysim_export_model.scene import scene_of
    from anysim_export_model.write import write

    scene = scene_of(what, tuple(override or ()))
    folder = out or Path("runs") / "models" / f"{Path(what).stem or scene.name}-{to}"
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())) and not force:
        raise AnysimError(f"there is something in {folder} already; give another --out, or --force to write into it")
    written = write(scene, to, folder, entities=tuple(entity or ()))
    if json:
        print_json(
            {
                "files": [str(path) for path in written.files],
                "meshes": [str(path) for path in written.meshes],
                "notes": [note._asdict() for note in written.notes],
            }
        )
        return
    for path in written.files:
        typer.echo(str(path))
    if written.meshes:
        typer.echo(f"{len(written.meshes)} meshes in {written.meshes[0].parent}")
    for note in written.notes:
        typer.echo(f"  {note}")
