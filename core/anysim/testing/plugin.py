"""The pytest plugin of the contract suites: `--engine`, `--planner`, `--family`, and the line that sums a run up.

It is loaded by every pytest run on a machine that has anysim, so it imports nothing but the standard library and
pytest until `--engine`, `--planner` or `--family` is given.
"""

import importlib
import json
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).parent
PLANNERS = HERE / "planners"
FAMILIES = HERE / "families"
CLAIMS = "anysim_claims"
NEEDS = "anysim_needs"
OVERLAPS = "anysim_overlaps"
_SUITE = pytest.StashKey[frozenset[str]]()
_ABSENT = re.compile(r"does not declare '([^']+)'")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the suite's options."""
    group = parser.getgroup("anysim", "the contract suite of anysim's physics engines (--pyargs anysim.testing)")
    group.addoption("--engine", metavar="NAME", help="the engine under test: an installed name, or module:Class")
    group.addoption(
        "--engine-option",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="an option of the engine, may be repeated; the value is read as JSON, else as text",
    )
    group.addoption(
        "--shards", metavar="N", type=int, default=0, help="run the engine in N worker processes, fewer for fewer envs"
    )
    group.addoption("--planner", metavar="NAME", help="the planner of motion under test (anysim.testing.planners)")
    group.addoption("--family", metavar="NAME", help="the family under test (anysim.testing.families)")
    group.addoption(
        "--family-option",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="a parameter of the family, may be repeated; the value is read as JSON, else as text",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker; with an engine to test, look whether it can run here, and register the fixtures."""
    config.addinivalue_line("markers", f"{NEEDS}(*capabilities): skip where the engine does not declare them all")
    config.addinivalue_line("markers", f"{OVERLAPS}: begins inside of something, which makes energy: it is not counted")
    config.addinivalue_line("markers", f"{CLAIMS}(*capabilities): skip where the planner does not declare them all")
    if name := config.getoption("planner"):
        try:
            planner_class(config)
        except Exception as error:  # whatever a stranger's planner raises is the answer to its name
            raise pytest.UsageError(f"--planner {name}: {error}") from error
        config.pluginmanager.register(importlib.import_module("anysim.testing.planners.fixtures"), "anysim-planners")
    if config.getoption("family"):
        config.pluginmanager.register(importlib.import_module("anysim.testing.families.fixtures"), "anysim-families")
    name = config.getoption("engine")
    if not name:
        return
    try:
        here = load_engine(name).availability()
    except Exception as error:  # whatever a stranger's engine raises is the answer to its name
        raise pytest.UsageError(f"--engine {name}: {error}") from error
    if not here.available:
        raise pytest.UsageError(f"--engine {name} cannot run here: {'; '.join(here.missing)}. {here.remedy}")
    pytest.register_assert_rewrite("anysim.testing.compare")
    config.pluginmanager.register(importlib.import_module("anysim.testing.fixtures"), "anysim-contract-fixtures")


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """With an engine to test, the suites of planners and families are no part of its own."""
    absent = (collection_path == PLANNERS and not config.getoption("planner")) or (
        collection_path == FAMILIES and not config.getoption("family")
    )
    return True if absent else None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Note which tests are the suite's, and refuse to run them without an engine: each would lack its fixtures."""
    suites = [item for item in items if item.path.is_relative_to(HERE)]
    config.stash[_SUITE] = frozenset(item.nodeid for item in suites)
    if any(item.path.is_relative_to(PLANNERS) for item in suites) and not config.getoption("planner"):
        raise pytest.UsageError("this suite tests one planner: pytest --pyargs anysim.testing.planners --planner NAME")
    if any(item.path.is_relative_to(FAMILIES) for item in suites) and not config.getoption("family"):
        raise pytest.UsageError("this suite tests one family: pytest --pyargs anysim.testing.families --family NAME")
    others = [item for item in suites if not any(item.path.is_relative_to(own) for own in (PLANNERS, FAMILIES))]
    if others and not config.getoption("engine"):
        raise pytest.UsageError("the contract suite tests one engine: pytest --pyargs anysim.testing --engine NAME")


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """One line: engine or planner, version, counts, and what was skipped for want of which capability."""
    suite = config.stash.get(_SUITE, frozenset())
    if not suite or not any(map(config.getoption, ("engine", "planner", "family"))):
        return
    outcomes = {
        kind: [r for r in terminalreporter.stats.get(kind, []) if getattr(r, "nodeid", "") in suite]
        for kind in ("passed", "failed", "error", "skipped")
    }
    missing = Counter(_reason(report) for report in outcomes["skipped"])
    detail = ", ".join(f"{name}: {count}" for name, count in sorted(missing.items()))
    counts = [f"{len(outcomes['passed'])} passed"]
    failures = len(outcomes["failed"]) + len(outcomes["error"])
    counts += [f"{failures} failed"] if failures else []
    counts += [f"{len(outcomes['skipped'])} skipped" + (f" ({detail})" if detail else "")]
    if family := config.getoption("family"):
        engine = config.getoption("engine") or "null"
        terminalreporter.write_line(f"anysim contract: family {family} on {engine}: {', '.join(counts)}")
        return
    if not config.getoption("engine"):
        planner = planner_class(config)
        terminalreporter.write_line(f"anysim contract: planner {planner.name} {planner.version}: {', '.join(counts)}")
        return
    engine = engine_class(config)
    version = engine.availability().version
    where = f" in {config.getoption('shards')} shards" if config.getoption("shards") else ""
    terminalreporter.write_line(f"anysim contract: engine {engine.name} {version}{where}: {', '.join(counts)}")


def engine_class(config: pytest.Config) -> Any:
    """The SimEngine class that `--engine` names, in worker processes if `--shards` says so."""
    engine = load_engine(str(config.getoption("engine")))
    if not (shards := config.getoption("shards")):
        return engine
    from anysim.engine.executor import executor

    return executor().engine_class(engine, shards, None)


def load_engine(name: str) -> Any:
    """The SimEngine class of an installed name, or of `module:Class`."""
    module, colon, attribute = name.partition(":")
    # `dist:name` chooses between distributions; engines' names are in lower case, classes are not
    if colon and attribute[:1].isupper():
        return getattr(importlib.import_module(module), attribute)
    from anysim.engine.factory import engine_class as installed

    return installed(name)


def planner_class(config: pytest.Config) -> Any:
    """The MotionPlanner class that `--planner` names: an installed name, or `module:Class`."""
    from anysim import registry
    from anysim.planning.motion import MotionPlanner

    name = str(config.getoption("planner"))
    module, colon, attribute = name.partition(":")
    outside = colon and attribute[:1].isupper()
    made = getattr(importlib.import_module(module), attribute) if outside else registry.load("planners", name)
    if not (isinstance(made, type) and issubclass(made, MotionPlanner)):
        raise pytest.UsageError("it is no planner of motion: expected a class derived from MotionPlanner")
    return made


def engine_options(config: pytest.Config) -> dict[str, Any]:
    """The options that `--engine-option` gives."""
    return named_values(config.getoption("engine_option"), "--engine-option")


def named_values(texts: Sequence[str] | None, option: str) -> dict[str, Any]:
    """What an option that takes KEY=VALUE gives, each value read as JSON, else as text."""
    options: dict[str, Any] = {}
    for text in texts or ():
        key, equals, value = text.partition("=")
        if not equals:
            raise pytest.UsageError(f"{option} takes KEY=VALUE, got '{text}'")
        try:
            options[key] = json.loads(value)
        except json.JSONDecodeError:
            options[key] = value
    return options


def _reason(report: Any) -> str:
    """The capability that a skip names, else its whole reason."""
    text = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
    found = _ABSENT.search(text)
    return found.group(1) if found else text.removeprefix("Skipped: ")
