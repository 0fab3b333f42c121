"""`anysim audit`: read the world back from the live engine."""

from typing import Annotated

import typer

from anysim.cli.options import AsJson, Engine, Overrides, Task


def audit(
    task: Task,
    engine: Engine = None,
    every: Annotated[bool, typer.Option("--all", help="Show every row, not only those that differ.")] = False,
    override: Overrides = None,
    json: AsJson = False,
) -> None:
    """Build a world on an engine, read everything back, and compare it with the World.

    Masses, centres of mass, principal moments, joint limits, damping, friction, armature, effort limits, collision
    volumes, and body frames at random joint positions. Exit code 1 if anything differs.
    """
    from anysim.api import compile_world, load
    from anysim.cli.output import print_json, print_table
    from anysim.engine.audit import audit as run_audit
    from anysim.engine.factory import create_simulation

    loaded = load(task, overrides=override or [])
    name = engine or loaded.spec.engine.name
    options = loaded.spec.engine.options if name == loaded.spec.engine.name else {}
    with create_simulation(name, **options) as simulation:
        simulation.create_world(compile_world(loaded))
        lines = run_audit(simulation)
        version = simulation.version
    wrong = [line for line in lines if line.ok is False]
    unreported = sorted({line.quantity for line in lines if line.ok is None})
    compared = sum(line.ok is not None for line in lines)
    if json:
        print_json({
            "engine": name, "version": version, "compared": compared, "different": len(wrong),
            "not_reported": unreported, "rows": [line._asdict() for line in (lines if every else wrong)],
        })  # fmt: skip
    else:
        shown = lines if every else wrong
        if shown:
            rows = [
                (
                    x.subject,
                    x.quantity,
                    _numbers(x.expected),
                    _numbers(x.found),
                    {True: "ok", False: "DIFFERS", None: "not reported"}[x.ok],
                )
                for x in shown
            ]
            print_table(f"Audit on {name} {version}", ("what", "quantity", "world", "engine", ""), rows)
        typer.echo(f"{compared} numbers compared on {name} {version}: {len(wrong)} differ")
        if unreported:
            typer.echo(f"not reported by the engine: {', '.join(unreported)}")
    if wrong:
        raise typer.Exit(1)


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(f"{v:.6g}" for v in values)
