"""`anysim audit`: read the world back from the live engine."""

from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from anysim.cli.options import AsJson, Overrides, Task

if TYPE_CHECKING:
    from anysim.testing.audit import AuditLine


class _EngineAudit(NamedTuple):
    engine: str
    version: str
    lines: "list[AuditLine]"

    @property
    def wrong(self) -> "list[AuditLine]":
        return [line for line in self.lines if line.ok is False]

    @property
    def unreported(self) -> list[str]:
        return sorted({line.quantity for line in self.lines if line.ok is None})

    @property
    def compared(self) -> int:
        return sum(line.ok is not None for line in self.lines)


def audit(
    task: Task,
    engine: Annotated[
        str | None,
        typer.Option(
            "--engine", "-e", help="Installed engines, separated by commas, or `all`; default that of the file."
        ),
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="Show every row, not only those that differ.")] = False,
    override: Overrides = None,
    json: AsJson = False,
) -> None:
    """Build a world on an engine, read everything back, and compare it with the World.

    Masses, centres of mass, principal moments, joint limits, damping, friction, armature, effort limits, collision
    volumes, joint axes, which bodies a joint moves, and body frames at random joint positions. A difference within what
    the engine declares is shown and counts as equal. Exit code 1 if anything differs. Cameras take no part: an engine
    that cannot draw can still be audited.

    Examples:
      anysim audit pick_cube
      anysim audit my_world.yaml --engine all
      anysim audit pick_cube --engine mujoco,sapien --all
    """
    from anysim.api import compile_world, load
    from anysim.cli.output import print_json
    from anysim.compile.edit import unseen
    from anysim.engine.factory import create_simulation
    from anysim.testing.audit import audit as run_audit

    loaded = load(task, overrides=override or [])
    world = unseen(compile_world(loaded))
    audited: list[_EngineAudit] = []
    for name in _engines(engine, loaded.spec.engine.name):
        options = loaded.spec.engine.options if name == loaded.spec.engine.name else {}
        with create_simulation(name, **options) as simulation:
            simulation.create_world(world)
            audited.append(_EngineAudit(name, simulation.version, run_audit(simulation)))
    if json:
        documents = [_document(one, every) for one in audited]
        print_json(documents[0] if len(documents) == 1 else documents)
    else:
        for one in audited:
            _tell(one, every)
    if any(one.wrong for one in audited):
        raise typer.Exit(1)


def _engines(text: str | None, default: str) -> list[str]:
    if text is None:
        return [default]
    if text == "all":
        from anysim.engine.factory import runnable

        return list(runnable())
    return [part.strip() for part in text.split(",") if part.strip()]


def _document(one: _EngineAudit, every: bool) -> dict[str, Any]:
    return {
        "engine": one.engine,
        "version": one.version,
        "compared": one.compared,
        "different": len(one.wrong),
        "declared": sum(bool(line.note) for line in one.lines),
        "not_reported": one.unreported,
        "rows": [line._asdict() for line in (one.lines if every else one.wrong)],
    }


def _tell(one: _EngineAudit, every: bool) -> None:
    from anysim.cli.output import print_table

    title = f"{one.engine} {one.version}"
    shown = [line for line in one.lines if every or line.ok is False or line.note]
    if shown:
        rows = [(x.subject, x.quantity, _numbers(x.expected), _numbers(x.found), _word(x)) for x in shown]
        print_table(f"Audit on {title}", ("what", "quantity", "world", "engine", ""), rows)
    typer.echo(f"{one.compared} numbers compared on {title}: {len(one.wrong)} differ")
    if one.unreported:
        typer.echo(f"not reported by the engine: {', '.join(one.unreported)}")


def _word(line: "AuditLine") -> str:
    if line.ok:
        return line.note or "ok"
    return "not reported" if line.ok is None else "DIFFERS"


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(f"{v:.6g}" for v in values)
