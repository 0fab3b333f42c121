"""`anysim map` and `anysim bench navmesh`."""

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


def navmesh(
    rooms: Annotated[int, typer.Option(min=1, help="Furnished rooms.")] = 20,
    queries: Annotated[int, typer.Option(min=1, help="Queries in each.")] = 200,
    compared: Annotated[int, typer.Option(min=0, help="Ways in each that are held against the shortest.")] = 20,
    radius: Annotated[float, typer.Option(min=0.01, help="Of what moves there [m].")] = 0.25,
    json: AsJson = False,
) -> None:
    """Ways through furnished rooms: failures, lengths against the shortest, clearance, and what meshes and ways cost.

    Examples:
      anysim bench navmesh --rooms 200
    """
    import numpy as np

    from anysim.cli.output import counting, print_json, print_table
    from anysim_navigation.agent import Agent
    from anysim_navigation.bench import measure_room, random_room

    agent, rng = Agent(radius), np.random.default_rng(0)
    found = []
    measure_room(random_room(0), agent, 1, np.random.default_rng(0), compared=0)  # kernels are compiled
    with counting("rooms", rooms, quiet=json) as show:
        for seed in range(rooms):
            found.append(measure_room(random_room(seed), agent, queries, rng, compared=compared))
            show(f"room {seed}: {found[-1].ways} ways, {found[-1].refused} refused", "")
    excess = np.array([e for one in found for e in one.excess] or [np.nan])
    query = 1e3 * np.array([t for one in found for t in one.query] or [np.nan])
    bake = 1e3 * np.array([one.bake for one in found])
    figures = {
        "ways": sum(one.ways for one in found),
        "refused": sum(one.refused for one in found),
        "failures": sum(one.failures for one in found),
        "nearest_over_radius_m": min(one.nearest for one in found),
        "length_median": float(np.median(excess)),
        "length_p95": float(np.quantile(excess, 0.95)),
        "length_max": float(excess.max()),
        "bake_ms_p50": float(np.median(bake)),
        "bake_ms_p95": float(np.quantile(bake, 0.95)),
        "query_ms_p50": float(np.median(query)),
        "query_ms_p95": float(np.quantile(query, 0.95)),
        "triangles_p50": float(np.median([one.triangles for one in found])),
    }
    if json:
        print_json(figures)
        return
    rows = [(name.replace("_", " "), f"{value:.4g}") for name, value in figures.items()]
    print_table(f"Ways of a disc of {radius:g} m in {rooms} rooms, {queries} queries each", ("what", "is"), rows)
