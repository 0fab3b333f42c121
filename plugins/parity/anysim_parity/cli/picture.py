"""`anysim picture`: what a world looks like on each engine."""

from pathlib import Path
from typing import Annotated

import typer

from anysim.cli.options import Overrides, Seed, parts


def picture(
    world: Annotated[
        str, typer.Argument(metavar="WORLD|TASK", help="An installed task (`anysim list tasks`) or a YAML file.")
    ],
    engines: Annotated[
        str | None,
        typer.Option("--engines", "-e", help="Names separated by commas; default all installed ones that draw."),
    ] = None,
    num_envs: Annotated[int, typer.Option("--num-envs", "-n", min=1, help="Episodes, one in each env.")] = 4,
    seed: Seed = None,
    camera: Annotated[str | None, typer.Option(help="One of the world's; its first, or an overview.")] = None,
    size: Annotated[tuple[int, int] | None, typer.Option(help="Width and height of one image [px].")] = None,
    seconds: Annotated[float, typer.Option(min=0.0, help="Simulated time before the image is taken.")] = 0.0,
    columns: Annotated[int | None, typer.Option(min=1, help="Images side by side; default about square.")] = None,
    override: Overrides = None,
    out: Annotated[Path | None, typer.Option(help="The PNG file; default runs/pictures/<name>-seed<seed>.png.")] = None,
) -> None:
    """Draw the first episodes of a world, as each engine starts them, side by side in one PNG file.

    Needs a world, and no task. An engine that cannot run the world or draw is named with its reason.

    Examples:
      anysim picture pick_cube
      anysim picture my_world.yaml --engines mujoco,sapien -n 16 --seconds 1 --out world.png
    """
    from anysim.api import load
    from anysim.cli.output import working_on
    from anysim.engine.capability import Capability
    from anysim.engine.factory import runnable
    from anysim_parity.drawing import require_matplotlib
    from anysim_parity.world_pictures import pictures, sheet
    from anysim_schemas.files import exists

    require_matplotlib("the picture needs matplotlib")
    names = parts(engines, "--engines") if engines else list(runnable(Capability.RENDER_RGB))
    file = Path(world)
    with working_on(f"drawing {world}", in_a_pipe=True) as tell:
        tell(f"reading {world}")
        loaded = load(file if exists(file) else world, overrides=override or [])
        seed = loaded.spec.seed if seed is None else seed
        found = pictures(
            loaded, names, num_envs=num_envs, seed=seed, camera=camera, size=size, seconds=seconds, tell=tell
        )
        target = out or Path("runs") / "pictures" / f"{file.stem}-seed{seed}.png"
        figure = sheet(found, columns)
        target.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(target, dpi=150)
    for name, why in found.refused.items():
        typer.echo(f"{name} took no part: {why}", err=True)
    typer.echo(str(target))
