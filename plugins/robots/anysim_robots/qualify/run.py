"""Run the checks of one robot on one engine."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

from anysim.api import load, make
from anysim.assets.catalogue import CatalogueEntry, load_robot, missing_source
from anysim.compile.edit import unseen
from anysim.compile.world import CompiledWorld, compile_with_report
from anysim.engine.factory import availability, create_simulation
from anysim.errors import AnysimError, CapabilityError, PluginError
from anysim_robots.qualify.motion import hold_check, random_checks
from anysim_robots.qualify.oracle import Oracle, oracle_of
from anysim_robots.qualify.result import CHECKS, Check, Facts, Qualification, Status
from anysim_robots.qualify.stage import stage
from anysim_robots.qualify.statics import audit_check, facts_of, kinematics_check, source_check


class Durations(NamedTuple):
    """Simulated time of the checks that move [s]; without `random` there are no random actions and no replay."""

    hold: float = 5.0
    random: float = 10.0
    replay: float = 2.0


FULL = Durations()


def qualify(
    robot: str, engine: str, durations: Durations = FULL, tell: Callable[[str], object] = lambda words: None
) -> Qualification:
    """Qualify a robot of the catalogue, or of a YAML file, on an engine.

    Args:
        robot: a name of `anysim list robots`, or a file that ends with `.yaml`.
        engine: an installed engine.
        durations: how long it holds still and moves.
        tell: called with the name of each check before it begins.

    Returns:
        A verdict with a figure for each check. What breaks in one of them is its cause; the others are run all the same
        where that makes sense. Where the reader that the source is held against is not installed, the checks that need
        it are not asked, and say how to get it.

    Raises:
        PluginError: there is no such robot or engine.
        SpecError: the entry is not valid.
    """
    begun = time.perf_counter()
    entry = load_robot(robot)
    version = availability(engine).version
    name = entry.spec.name

    def ended(
        status: Status, checks: list[Check], why: str = "", oracle: str = "", facts: Facts | None = None
    ) -> Qualification:
        seconds = round(time.perf_counter() - begun, 1)
        return Qualification(name, engine, version, status, tuple(checks), why, oracle, facts, seconds)

    absent = missing_source(entry)
    if absent:
        return ended("absent", [], absent)
    checks: list[Check] = []
    tell("build")
    try:
        compiled = compile_with_report(load(stage(entry)).spec)
    except AnysimError as error:
        return ended("failed", [Check("build", False, words=f"no world can be made of it: {error}")])
    facts, notes = facts_of(compiled.world), compiled.report["robot"]
    oracle, lacking = _oracle(entry, compiled)
    reader = "" if oracle is None else oracle.name
    try:
        checks += _static(compiled, engine, oracle, tell)
    except CapabilityError as error:
        return ended("refused", [], str(error), reader, facts)
    except Exception as error:  # noqa: BLE001  whatever breaks is the answer to the question
        checks.append(Check("build", False, words=_words(error)))
    if oracle is None:
        checks += [Check(name, None, words=lacking) for name in ("source", "kinematics")]
    else:
        tell("source")
        with _noted(checks, "source"):
            checks.append(source_check(compiled.world, oracle, notes))
    if checks[0].passed:
        checks += _moving(entry, engine, durations, tell)
    order = list(CHECKS)
    checks.sort(key=lambda check: order.index(check.name))
    status: Status = "failed" if any(c.passed is False for c in checks) else "qualified"
    return ended(
        status, checks, "" if oracle is not None else f"source and kinematics are not asked: {lacking}", reader, facts
    )


def _oracle(entry: CatalogueEntry, compiled: CompiledWorld) -> tuple[Oracle | None, str]:
    """Whom the source is held against; None and how to get it where that is not installed."""
    try:
        return oracle_of(entry, compiled.world), ""
    except PluginError as error:
        return None, str(error)


def _static(compiled: CompiledWorld, engine: str, oracle: Oracle | None, tell: Callable[[str], object]) -> list[Check]:
    found: list[Check] = []
    with create_simulation(engine) as simulation:
        simulation.create_world(unseen(compiled.world))
        found.append(Check("build", True))
        tell("audit")
        with _noted(found, "audit"):
            found.append(audit_check(simulation))
        if oracle is not None:
            tell("kinematics")
            with _noted(found, "kinematics"):
                found.append(kinematics_check(simulation, oracle))
    return found


def _moving(entry: CatalogueEntry, engine: str, durations: Durations, tell: Callable[[str], object]) -> list[Check]:
    found: list[Check] = []
    tell("hold")
    with _noted(found, "hold"), make(stage(entry), engine=engine, num_envs=1) as env:
        found.append(hold_check(env, durations.hold))
        if not durations.random:
            return found
        tell("random")
        with _noted(found, "random"):
            found += random_checks(env, durations.random, durations.replay, tell)
    return found


@contextmanager
def _noted(found: list[Check], name: str) -> Iterator[None]:
    """What breaks within becomes the cause of that check."""
    try:
        yield
    except Exception as error:  # noqa: BLE001  whatever breaks is the answer to the question
        found.append(Check(name, False, words=_words(error)))


def _words(error: Exception) -> str:
    return str(error) if isinstance(error, AnysimError) else f"{type(error).__name__}: {error}"
