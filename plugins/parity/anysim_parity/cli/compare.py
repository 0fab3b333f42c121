"""`anysim compare`: the same world on several engines, and the gap layer by layer."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from anysim.cli.options import AsJson, Overrides, Seed

if TYPE_CHECKING:
    from anysim_parity.report import Comparison


def compare(
    task: Annotated[
        str, typer.Argument(metavar="WORLD|TASK", help="An installed task (`anysim list tasks`) or a YAML file.")
    ],
    engines: Annotated[
        str | None,
        typer.Option("--engines", "-e", help="Names separated by commas; default all installed ones with dynamics."),
    ] = None,
    episodes: Annotated[int, typer.Option("--episodes", "-k", min=1, help="Episodes of the layer task.")] = 16,
    seed: Seed = None,
    layers: Annotated[
        str | None,
        typer.Option(help="Some of asset, kinematics, actuation, contact, camera, task; default all that apply."),
    ] = None,
    override: Overrides = None,
    out: Annotated[
        Path | None, typer.Option(help="Directory of the report; default runs/compare/<name>-seed<seed>.")
    ] = None,
    strict: Annotated[bool, typer.Option("--strict", help="Exit with 1 if anything is beyond its tolerance.")] = False,
    json: AsJson = False,
) -> None:
    """Run the same world, seeds and actions on several engines, and say how far they agree, layer by layer.

    asset: what each engine says it has built. kinematics: where links are at the same joint positions, their
    Jacobians and masses. actuation: a tape of joint targets where nothing can be touched. contact: drop, bounce,
    slide, roll, tilt, stack and grasp, against mechanics. camera: images of the same scene. task: the expert in the
    same episodes.

    Each layer rests on those before it, so the first that differs explains most of the rest. The report is a JSON
    file and one HTML page with plots, which needs nothing else.

    Examples:
      anysim compare pick_cube
      anysim compare pick_cube --engines mujoco,sapien --layers kinematics,actuation
      anysim compare my_world.yaml --seed 3 --out runs/compare/mine --strict
    """
    from anysim.api import load
    from anysim_parity import run
    from anysim_parity.report import as_data
    from anysim_parity.verdict import disagreements
    from anysim_parity.write import check_out, write

    loaded = load(task, overrides=override or [])
    seed = loaded.spec.seed if seed is None else seed
    name = Path(task).stem
    directory = out or Path("runs") / "compare" / f"{name}-seed{seed}"
    check_out(directory)
    with _progress(json) as report:
        found = run.compare(
            loaded, _names(engines), _names(layers), episodes=episodes, seed=seed, name=name, report=report
        )
    written = write(found, directory)
    if json:
        from anysim.cli.output import print_json

        print_json(as_data(found) | {"json": str(written.json), "html": str(written.html) if written.html else None})
    else:
        _tell(found)
        typer.echo(f"numbers: {written.json}")
        typer.echo(f"page:    {written.html}" if written.html else f"no page: {written.trouble}")
    if strict and disagreements(found.layers):
        raise typer.Exit(1)


def _names(text: str | None) -> list[str] | None:
    return None if text is None else [part.strip() for part in text.split(",") if part.strip()]


def _tell(found: "Comparison") -> None:
    """The table of who agrees with whom, and why anything is missing."""
    from itertools import combinations

    from anysim.cli.output import print_table
    from anysim_parity.verdict import ANALYTIC, between, findings

    names = list(found.engines)
    pairs = [*combinations(names, 2), *((name, ANALYTIC) for name in names)]
    rows = []
    for layer in found.layers:
        all_of_it = findings(layer)
        rows.append((layer.name, *(_cell(between(all_of_it, a, b)) for a, b in pairs)))
    heads = ["layer", *(f"{a} - {'answer' if b == ANALYTIC else b}" for a, b in pairs)]
    versions = ", ".join(f"{name} {version}" for name, version in found.engines.items())
    print_table(f"{found.name} on {versions}", heads, rows)
    for layer in found.layers:
        for name, why in layer.refused.items():
            typer.echo(f"{layer.name}: {name} took no part: {why}")


def _cell(found: list[Any]) -> str:
    from anysim_parity.verdict import worst

    top = worst(found)
    if top is None:
        return "-"
    beyond = sum(not f.agree for f in found)
    if not beyond:
        return f"agree ({len(found)})"
    known = sum(f.declared for f in found if not f.agree)
    how = "as declared" if known == beyond else f"{beyond - known} not declared"
    return f"{beyond} of {len(found)} differ ({how}); {top.subject}: {top.gap:.3g} {top.unit}".rstrip()


@contextmanager
def _progress(quiet: bool) -> Iterator[Any]:
    """A progress bar for a person, a line for each layer in a pipe, nothing with --json."""
    from anysim.cli.output import interactive

    if quiet:
        yield lambda layer, done, total: None
        return
    if not interactive():
        yield lambda layer, done, total: typer.echo(f"measuring {layer}…") if not total else None
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    with Progress(TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), transient=True) as progress:
        bar = progress.add_task("comparing", total=None)
        yield lambda layer, done, total: progress.update(bar, description=layer, completed=done, total=total or None)
