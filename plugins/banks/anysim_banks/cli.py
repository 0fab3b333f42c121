"""`anysim bank`: candidate banks of grasps."""

from pathlib import Path
from typing import Annotated

import typer

from anysim.cli.options import AsJson

app = typer.Typer(help="Make and show banks of grasps that were tried in physics.", no_args_is_help=True)


@app.callback()
def _group() -> None:
    pass


@app.command("build")
def build(
    what: Annotated[
        str,
        typer.Argument(
            metavar="ASSET|TASK",
            help="A task or YAML file with objects; or one asset: procedural:cabinet, a URDF, MJCF or mesh file, or a "
            "source as in YAML: '{box: [0.04, 0.06, 0.1]}'.",
        ),
    ],
    object: Annotated[str, typer.Option(help="One object of the task; default: all that afford a grasp.")] = "",
    affordance: Annotated[str, typer.Option("--affordance", "-a", help="One affordance; default: all.")] = "",
    engine: Annotated[
        str,
        typer.Option(
            "--engine", "-e", help="Engines, separated by commas; the first tries all, the others those kept."
        ),
    ] = "mujoco",
    gripper: Annotated[
        str,
        typer.Option(
            "--gripper",
            "-g",
            help="A procedural gripper, as parallel_gripper:stroke=0.1,force=40, or a robot whose hand has fingers.",
        ),
    ] = "parallel_gripper",
    raw: Annotated[int, typer.Option(min=1, help="How many grasps are sampled of each affordance.")] = 2000,
    keep: Annotated[int, typer.Option(min=1, help="How many are kept of each, as different as they can be.")] = 64,
    seed: Annotated[int, typer.Option("--seed", "-s", min=0, help="The seed of the sampling.")] = 0,
    anchors: Annotated[
        Path | None,
        typer.Option(
            "--affordances",
            "--anchors",
            help="A JSON document of regions to take hold of, in place of what the asset affords; what holds there in "
            "physics becomes a bank, and nothing else of it is ever executed.",
        ),
    ] = None,
    robot: Annotated[
        str,
        typer.Option(help="A robot of the catalogue: only grasps that inverse kinematics has its arm reach are kept."),
    ] = "",
    base: Annotated[
        list[str] | None,
        typer.Option(
            metavar="X,Y,Z,YAW",
            help="Where the robot stands, in the frame of the asset [m, rad]; several may be given. Default: the best "
            "of sampled ones, on the plane that the asset stands on.",
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of the banks, one file for each affordance.")] = Path("banks"),
    json: AsJson = False,
) -> None:
    """Sample grasps on what assets afford, filter them by collision, try them in physics, and keep the best.

    A bank that is there already, of the same asset, gripper and numbers, is not made again: engines that it lacks are
    added, so the same command goes on where an interrupted one stopped.

    Examples:
      anysim bank build procedural:cabinet -a drawer_1.handle -e mujoco,pybullet,sapien
      anysim bank build pick_cube --object cube --keep 32 --out banks
      anysim bank build procedural:cabinet -a drawer_1.handle --robot mobile_panda
    """
    from anysim.cli.output import counting, print_json, print_table
    from anysim.errors import AssetError
    from anysim_banks.building import Row, Wish, build_all, works
    from anysim_banks.reach import parse_bases

    wish = Wish(what, object, affordance, tuple(engine.split(",")), gripper, raw, keep, seed, anchors, out)
    wish = wish._replace(robot=robot, bases=parse_bases(base or [], robot))
    todo = works(wish)
    rows: list[Row] = []
    with counting("banks", len(todo), quiet=json) as show:
        for row in build_all(todo, wish):
            rows.append(row)
            show(row.line, row.name)
    made = [row for row in rows if row.bank is not None]
    if json:
        print_json({"banks": [row.summary() for row in rows]})
    else:
        columns = ("affordance", "raw", "free", "held", "kept", *wish.engines, "best", "raw/s", "file")
        print_table("Banks", columns, [row.cells(wish.engines) for row in made])
    if not made:
        raise AssetError("; ".join(row.line for row in rows))


@app.command("show")
def show(
    files: Annotated[list[Path], typer.Argument(metavar="FILE…", help="Banks.")],
    count: Annotated[int, typer.Option("--count", "-k", min=1, help="How many candidates of each are listed.")] = 10,
    json: AsJson = False,
) -> None:
    """Say where banks come from, on which engines they hold, and their best candidates.

    Examples:
      anysim bank show banks/*.json -k 3
    """
    from anysim.cli.output import print_json, print_table
    from anysim.skills.bank import read_bank

    banks = [read_bank(path) for path in files]
    if json:
        print_json([bank.document() | {"version": bank.version} for bank in banks])
        return
    for bank, path in zip(banks, files, strict=True):
        passed = ", ".join(f"{int(rows.sum())} on {engine}" for engine, rows in bank.passed.items())
        typer.echo(f"{path}: {bank.affordance} of {bank.asset} for {bank.gripper}, version {bank.version}")
        typer.echo(f"{len(bank)} candidates; held: {passed}")
        rows = [
            (
                number,
                bank.kind[number],
                f"{bank.margin[number]:.1f}",
                f"{bank.width[number]:.4f}",
                " ".join(f"{x:.3f}" for x in bank.pose[number, :3]),
                " ".join(f"{x:.2f}" for x in bank.approach[number]),
            )
            for number in range(min(count, len(bank)))
        ]
        print_table("", ("candidate", "kind", "margin", "width [m]", "position [m]", "approach"), rows)
