"""`anysim check`: read files and say everything that is wrong with them."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from anysim.cli.options import AsJson, Engine, Overrides

if TYPE_CHECKING:
    from anysim_schemas.load import LoadedRun


def check(
    files: Annotated[list[str], typer.Argument(metavar="FILE…", help="YAML files, or installed tasks by name.")],
    engine: Engine = None,
    all_engines: Annotated[bool, typer.Option("--all-engines", help="Check against every installed engine.")] = False,
    override: Overrides = None,
    json: AsJson = False,
) -> None:
    """Check files: spelling, types and ranges, assets and references, and whether the engine can run the world.

    Nothing is built. Exit code 1 if a file has faults. A file's own engine is checked unless --engine or --all-engines
    says otherwise.
    """
    from anysim.cli.output import print_json

    reports = {name: check_one(name, engine, all_engines, override or []) for name in files}
    if json:
        print_json({name: {"ok": not faults, "faults": faults} for name, faults in reports.items()})
    else:
        for name, faults in reports.items():
            for fault in faults:
                typer.echo(fault, err=True)
            typer.echo(f"{name}: {'ok' if not faults else f'{len(faults)} faults'}")
    if any(reports.values()):
        raise typer.Exit(1)


def check_one(name: str, engine: str | None, all_engines: bool, overrides: list[str]) -> list[str]:
    """Every fault of one file, a sentence each; empty if it can be run."""
    from anysim import registry
    from anysim.api import check_engine, compile_world, dry_run, load
    from anysim.engine.factory import engine_class
    from anysim.errors import AnysimError, AssetError, SpecError

    try:
        loaded = load(Path(name) if Path(name).exists() else name, overrides=overrides)
        world = compile_world(loaded)
        if loaded.spec.task is not None:
            dry_run(loaded, world)
            _check_film(loaded)
    except (SpecError, AssetError) as error:
        return [str(issue) for issue in error.issues] or [f"{name}: {error}"]
    except AnysimError as error:
        return [f"{name}: {error}"]
    engines = registry.names("engines") if all_engines else [engine or loaded.spec.engine.name]
    faults: list[str] = []
    for one in engines:
        try:
            check_engine(loaded, world, engine_class(one), name)
        except SpecError as error:
            return [str(issue) for issue in error.issues]
        except AnysimError as error:
            faults.append(f"{name}: {error}")
    return faults


def _check_film(loaded: "LoadedRun") -> None:
    """Whether episodes can be filmed when the file wants them filmed."""
    from anysim.api import located
    from anysim.errors import SpecError
    from anysim.record.film import film_mode

    try:
        film_mode(loaded.spec)
    except SpecError as error:
        raise located(error, loaded) from None
