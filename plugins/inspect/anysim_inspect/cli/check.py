"""`anysim check`: read files and say everything that is wrong with them."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from anysim.cli.options import AsJson, Engine, Overrides, Robot, Verbose, with_robot

if TYPE_CHECKING:
    from anysim.model.world import World
    from anysim_schemas.load import LoadedRun
    from anysim_schemas.task import TaskSpec

STEPS_AHEAD = 100
"""Control steps of reward that a learner with the usual discount of 0.99 looks ahead: 1 / (1 - 0.99)."""


class Answer(NamedTuple):
    """Whether one engine can run a file: why not (empty if it can), and what it does only approximately, in sentences.

    `approximate` is the short form, `measured` has a line with the measured error for each.
    """

    engine: str
    refusal: str = ""
    approximate: tuple[str, ...] = ()
    measured: tuple[str, ...] = ()


class Report(NamedTuple):
    """Every fault of a file, the answer of each engine that was asked, what is ill-conditioned, and the world."""

    faults: list[str]
    answers: tuple[Answer, ...] = ()
    warnings: tuple[str, ...] = ()
    world: "World | None" = None


def check(
    files: Annotated[list[str], typer.Argument(metavar="FILE…", help="YAML files, or installed tasks by name.")],
    engine: Engine = None,
    all_engines: Annotated[bool, typer.Option("--all-engines", help="Ask every installed engine.")] = False,
    robot: Robot = None,
    override: Overrides = None,
    verbose: Verbose = False,
    json: AsJson = False,
) -> None:
    """Check files: spelling, types and ranges, assets and references, and whether the engine can run the world.

    Nothing is built. Exit code 1 if a file has faults. A file's own engine is checked unless --engine or --all-engines
    says otherwise. With --all-engines a file is at fault only if no engine can run it; which can is said of each.

    Examples:
      anysim check my_world.yaml
      anysim check pick_cube --robot ur5_gripper
      anysim check pick_cube --all-engines --verbose
    """
    from anysim.cli.output import print_json

    reports = {name: report_on(name, engine, all_engines, with_robot(override, robot)) for name in files}
    if json:
        print_json({name: _as_data(report) for name, report in reports.items()})
    else:
        for name, report in reports.items():
            _tell(name, report, all_engines, verbose)
    if any(report.faults for report in reports.values()):
        raise typer.Exit(1)


def _as_data(report: Report) -> dict[str, object]:
    engines = {a.engine: {"runs": not a.refusal, "why": a.refusal, "approximate": a.measured} for a in report.answers}
    notes = [] if report.world is None else [f"{thing}: {note}" for thing, note in report.world.notes]
    return {
        "ok": not report.faults,
        "faults": report.faults,
        "warnings": report.warnings,
        "engines": engines,
        "notes": notes,
    }


def _tell(name: str, report: Report, all_engines: bool, verbose: bool) -> None:
    from anysim.cli.output import import_notes

    for fault in report.faults:
        typer.echo(fault, err=True)
    for warning in report.warnings:
        typer.echo(f"warning: {warning}", err=True)
    for answer in report.answers:
        if answer.refusal and answer.refusal not in report.faults:
            typer.echo(answer.refusal, err=True)
        for line in answer.measured if verbose else answer.approximate:
            typer.echo(f"{answer.engine}: {line}" if verbose else line)
    for line in [] if report.world is None else import_notes(report.world, verbose, f"anysim check {name}"):
        typer.echo(line)
    count = len(report.faults)
    verdict = f"{count} {'fault' if count == 1 else 'faults'}" if count else "ok"
    if all_engines and report.answers:
        able = [answer.engine for answer in report.answers if not answer.refusal]
        unable = [answer.engine for answer in report.answers if answer.refusal]
        verdict += f"; runs on {', '.join(able) or 'no engine'}"
        verdict += f"; not on {', '.join(unable)}" if unable else ""
    typer.echo(f"{name}: {verdict}")


def report_on(name: str, engine: str | None, all_engines: bool, overrides: list[str]) -> Report:
    """Every fault of one file, its levels and alternates, and what each engine that is asked says to it."""
    report, choices = _report_on(name, engine, all_engines, overrides)
    for choice in choices:
        faults = _report_on(name, engine, all_engines, [*overrides, choice])[0].faults
        report = report._replace(faults=report.faults + [fault for fault in faults if fault not in report.faults])
    return report


def _report_on(
    name: str, engine: str | None, all_engines: bool, overrides: list[str]
) -> tuple[Report, tuple[str, ...]]:
    """The report on a file as it is, and overrides that choose its levels, and alternates, where none is chosen."""
    from anysim import registry
    from anysim.api import compile_world, dry_run, load, place_of, watched
    from anysim.engine.conditioning import doubts
    from anysim.errors import AnysimError, AssetError, PluginFailure, SpecError, SpecIssue
    from anysim_schemas.files import exists

    past: list[SpecIssue] = []
    try:
        loaded = load(Path(name) if exists(name) else name, overrides=overrides, past=past)
        world = compile_world(loaded)
        if loaded.spec.task is not None or loaded.spec.world.sensors or loaded.spec.world.families:
            dry_run(watched(loaded), world)
            _check_film(loaded)
        found = [doubt[:2] for doubt in doubts(world)]
        found += [] if loaded.spec.task is None else _too_little_for_success(loaded.spec.task)
        warnings = tuple(str(SpecIssue(place_of(loaded, path), path, sentence)) for path, sentence in found)
        engines = registry.names("engines") if all_engines else [engine or loaded.spec.engine.name]
        if any(issue.path.startswith("engine") for issue in past):
            engines = []  # which one was meant is not known
        answers = tuple(_ask(one, loaded, world, name) for one in engines)
    except (SpecError, AssetError) as error:
        return Report([str(issue) for issue in [*past, *error.issues]] or [f"{name}: {error}"]), ()
    except PluginFailure:  # which says nothing of the file
        raise
    except AnysimError as error:
        return Report([*map(str, past), f"{name}: {error}"]), ()
    refused = [answer.refusal for answer in answers if answer.refusal]
    faults = [*map(str, past), *(refused if len(refused) == len(answers) else [])]
    spec = loaded.spec
    choices = [f"level={level}" for level in spec.levels] if spec.level is None else []
    choices += [] if spec.robot else [f"robot={robot}" for robot in spec.alternates if _is_own(robot, loaded)]
    return Report(faults, () if past else answers, warnings, world), tuple(choices)


def _is_own(robot: str, loaded: "LoadedRun") -> bool:
    """Whether an alternate is the file's own, and installed; what is no robot at all is to be told.

    One of a file that is extended is for that file: this one may have made it a task of a single robot.
    """
    from anysim.api import place_of
    from anysim.assets.catalogue import load_robot, missing_source
    from anysim.errors import AnysimError

    file = Path(place_of(loaded, f"alternates.{robot}").rsplit(":", 2)[0])
    if not loaded.files or file.resolve() != loaded.files[-1].resolve():
        return False
    try:
        return not missing_source(load_robot(robot))
    except AnysimError:
        return True


def _too_little_for_success(task: "TaskSpec") -> Iterator[tuple[str, str]]:
    """The key to change and a sentence, where success ends the steps' rewards and is worth less than they are.

    A learner would do better by not succeeding. Counted are terms that say how much they are `at_most`.
    """
    from anysim.task.contract import MOST
    from anysim.task.term_registry import find

    if task.on_success != "end" or not task.success:
        return
    steps = min(task.horizon, STEPS_AHEAD)
    bounds = [(term.weight, vars(find("reward", term.term)).get(MOST, 0.0)) for term in task.rewards.values()]
    gain = steps * sum(max(weight * most, 0.0) for weight, most in bounds)
    worth = sum(term.reward for term in task.success.values())
    if worth < gain:
        yield (
            "task.success",
            f"success is worth {worth:g} and ends rewards of up to {gain:g} in the {steps} steps that a learner with a "
            f"discount of 0.99 looks ahead, so that not to succeed can pay more; give a predicate of success `reward: "
            f"{gain - worth:g}` or more, or say `on_success: continue`",
        )


def _ask(engine: str, loaded: "LoadedRun", world: "World", name: str) -> Answer:
    """Whether an engine can run a world.

    Raises:
        SpecError: the file is at fault, whatever the engine.
    """
    from anysim.api import check_engine
    from anysim.cli.output import approximations
    from anysim.engine.factory import engine_class
    from anysim.errors import AnysimError, SpecError

    try:
        kind = engine_class(engine)
        needs = check_engine(loaded, world, kind, name)
    except SpecError:
        raise
    except AnysimError as error:
        return Answer(engine, f"{name}: {error}")
    command = f"anysim check {name} -e {engine}"
    short, long = (approximations(engine, kind.capabilities, needs, all_of_it, command) for all_of_it in (False, True))
    return Answer(engine, "", tuple(short), tuple(long))


def _check_film(loaded: "LoadedRun") -> None:
    """Whether episodes can be filmed when the file wants them filmed."""
    from anysim.api import located
    from anysim.errors import SpecError
    from anysim.record.film import film_mode

    try:
        film_mode(loaded.spec)
    except SpecError as error:
        raise located(error, loaded) from None
