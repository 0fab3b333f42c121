"""`anysim map`."""

from pathlib import Path
from typing import Annotated

import typer

from anysim.cli.options import AsJson, Overrides


def make_map(
    source: Annotated[str, typer.Argument(metavar="WORLD", help="A YAML file, or the name of a task.")],
    out: Annotated[Path, typer.Option(help="Directory of the files.")],
    radius: Annotated[float, typer.Option(min=0.01, help="Of what moves there [m].")] = 0.3,
    height: Annotated[
        float, typer.Option(min=0.01, help="Of what moves there [m]: what is higher is passed under.")
    ] = 1.2,
    step: Annotated[float, typer.Option(min=0.0, help="What is lower is driven over [m].")] = 0.03,
    resolution: Annotated[float, typer.Option(min=0.001, help="Edge of a cell [m].")] = 0.05,
    without: Annotated[list[str] | None, typer.Option(help="An entity to leave out; may be repeated.")] = None,
    override: Overrides = None,
    json: AsJson = False,
) -> None:
    """Map a world as it begins, without robots: an occupancy grid, a floor plan, and the walls of its room.

    map.yaml and map.png are what ROS's map_server loads; floor_plan.png shows where the middle of a disc of the radius
    can be; walls.json has each piece of wall, with the heights between which it stands.

    Examples:
      anysim map docs/worlds/room.yaml --out maps/room
    """
    from anysim.api import compile_world, load
    from anysim.cli.output import print_json
    from anysim_navigation.agent import Agent
    from anysim_navigation.floor_plan import write_map
    from anysim_schemas.files import exists

    file = Path(source)
    loaded = load(file if exists(file) else source, overrides=override or [])
    agent = Agent(radius, height, step)
    agent.check()
    made = write_map(compile_world(loaded), out, agent, resolution, tuple(without or ()))
    rows, columns = made.grid.occupied.shape
    share = float(made.grid.occupied.mean())
    if json:
        about = {"out": str(out), "rows": rows, "columns": columns, "resolution": resolution, "occupied": share}
        print_json({**about, "things": len(made.outlines), "walls": len(made.parts)})
        return
    typer.echo(
        f"{columns} x {rows} cells of {resolution:g} m, {100 * share:.0f} % occupied; {len(made.parts)} pieces of wall"
    )
    typer.echo(f"{out}: map.yaml, map.png, floor_plan.png, walls.json")
