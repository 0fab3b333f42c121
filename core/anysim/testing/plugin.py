"""The pytest plugin of the contract suite: `--engine`, `--engine-option`, and the line that sums a run up.

It is loaded by every pytest run on a machine that has anysim, so it imports nothing but the standard library and
pytest until `--engine` is given.
"""

import importlib
import json
import re
from collections import Counter
from typing import Any

import pytest

SUITE = "anysim/testing/"
NEEDS = "anysim_needs"
_ABSENT = re.compile(r"does not declare '([^']+)'")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the suite's options."""
    group = parser.getgroup("anysim", "the contract suite of anysim's physics engines (--pyargs anysim.testing)")
    group.addoption("--engine", metavar="NAME", help="the engine under test: an installed name, or module:Class")
    group.addoption(
        "--engine-option", metavar="KEY=VALUE", action="append", default=[],
        help="an option of the engine, may be repeated; the value is read as JSON, else as text",
    )  # fmt: skip


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker, and the fixtures where there is an engine to test."""
    config.addinivalue_line("markers", f"{NEEDS}(*capabilities): skip where the engine does not declare them all")
    if config.getoption("engine"):
        pytest.register_assert_rewrite("anysim.testing.compare")
        config.pluginmanager.register(importlib.import_module("anysim.testing.fixtures"), "anysim-contract-fixtures")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Refuse to run the suite without an engine: each of its tests would end in a missing fixture."""
    if not config.getoption("engine") and any(_in_suite(item.path.as_posix()) for item in items):
        raise pytest.UsageError("the contract suite tests one engine: pytest --pyargs anysim.testing --engine NAME")


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """One line: engine, version, counts, and what was skipped for want of which capability."""
    if not config.getoption("engine"):
        return
    outcomes = {
        kind: [r for r in terminalreporter.stats.get(kind, []) if _in_suite(getattr(r, "nodeid", ""))]
        for kind in ("passed", "failed", "error", "skipped")
    }
    if not any(outcomes.values()):
        return
    missing = Counter(_reason(report) for report in outcomes["skipped"])
    detail = ", ".join(f"{name}: {count}" for name, count in sorted(missing.items()))
    counts = [f"{len(outcomes['passed'])} passed"]
    failures = len(outcomes["failed"]) + len(outcomes["error"])
    counts += [f"{failures} failed"] if failures else []
    counts += [f"{len(outcomes['skipped'])} skipped" + (f" ({detail})" if detail else "")]
    engine = engine_class(config)
    version = engine.availability().version
    terminalreporter.write_line(f"anysim contract: engine {engine.name} {version}: {', '.join(counts)}")


def engine_class(config: pytest.Config) -> Any:
    """The SimEngine class that `--engine` names."""
    name: str = config.getoption("engine")
    module, colon, attribute = name.partition(":")
    # `dist:name` chooses between distributions; engines' names are in lower case, classes are not
    if colon and attribute[:1].isupper():
        return getattr(importlib.import_module(module), attribute)
    from anysim import registry

    return registry.load("engines", name)


def engine_options(config: pytest.Config) -> dict[str, Any]:
    """The options that `--engine-option` gives."""
    options: dict[str, Any] = {}
    for text in config.getoption("engine_option"):
        key, equals, value = text.partition("=")
        if not equals:
            raise pytest.UsageError(f"--engine-option takes KEY=VALUE, got '{text}'")
        try:
            options[key] = json.loads(value)
        except json.JSONDecodeError:
            options[key] = value
    return options


def _in_suite(path: str) -> bool:
    return SUITE in path


def _reason(report: Any) -> str:
    """The capability that a skip names, else its whole reason."""
    text = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
    found = _ABSENT.search(text)
    return found.group(1) if found else text.removeprefix("Skipped: ")
