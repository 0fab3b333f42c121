"""`anysim bench navmesh` and `anysim bench navigate`."""

from pathlib import Path
from typing import Annotated

import typer

from anysim.cli.options import AsJson, parts

WORDS = {"hardest_contact_n": "hardest [N]", "time_over_shortest": "time", "action_ms": "action [ms]"}
"""Heads of columns that are not the names of their figures."""


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
    from anysim_navigation_bench.rooms import measure_room, random_room

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


def navigate(
    robots: Annotated[
        str,
        typer.Option(
            help="Bases, separated by commas: of wheels, unitree_go1, unitree_go1_learned (by the policy of "
            "go1_velocity), unitree_g1, others with a base channel."
        ),
    ] = "differential_base,holonomic_base,ackermann_base",
    engines: Annotated[str, typer.Option("--engines", "-e", help="Installed engines, separated by commas.")] = "mujoco",
    rooms: Annotated[int, typer.Option(min=1, help="Furnished rooms for each.")] = 20,
    people: Annotated[int, typer.Option(min=0, max=8, help="Who walk there meanwhile and do not yield.")] = 0,
    pace: Annotated[float, typer.Option(min=0.1, max=2.0, help="Theirs, of the usual 0.2 to 0.5 m/s.")] = 1.0,
    out: Annotated[
        Path | None, typer.Option(help="A JSON file of all drives, which is added to: what it has is not driven again.")
    ] = None,
    json: AsJson = False,
) -> None:
    """Drive bases from end to end of furnished rooms in an engine, over 4 m each, with `planner: dynamic_window`.

    A way fails that takes 90 s (among people 180 s), or on which something in the room or a person is touched
    with more than 20 N.

    Examples:
      anysim bench navigate --robots holonomic_base --rooms 100
      anysim bench navigate --robots holonomic_base --people 4 --out people.json
      anysim bench navigate --robots unitree_g1 --people 4 --pace 0.4
    """
    from itertools import count

    from anysim.cli.output import counting, print_json, print_table
    from anysim_navigation_bench.drive_store import Cell, DriveStore, figures
    from anysim_navigation_bench.drives import drive

    store = DriveStore(out)
    cells = [
        Cell(robot, engine, people, pace)
        for robot in parts(robots, "--robots")
        for engine in parts(engines, "--engines")
    ]
    with counting("rooms", rooms * len(cells), quiet=json) as show:
        for cell in cells:
            known, driven = {one.seed: one for one in store.known(cell)}, 0
            for seed in count():
                if driven == rooms:
                    break
                one = known.get(seed)
                if one is None:
                    one = drive(seed, cell.robot, cell.engine, people=people, pace=pace)
                    if one is None:  # the room is too small for such a way
                        continue
                    store.add(cell, one)
                driven += 1
                show(f"{cell.robot}, {cell.engine}, room {seed}: {one.ended} after {one.seconds:.1f} s", "")
    found = [figures(cell, store.known(cell)[:rooms]) for cell in cells]
    if json:
        print_json(found)
        return
    heads = [WORDS.get(key, key) for key in found[0]]
    rows = [[_cell(value) for value in one.values()] for one in found]
    print_table(f"Ways over 4 m through {rooms} furnished rooms", heads, rows)


def _cell(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key}: {v}" for key, v in value.items())
    if isinstance(value, list):
        return " to ".join(map(str, value))
    return f"{value:.3g}" if isinstance(value, float) else str(value)
