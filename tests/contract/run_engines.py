"""Run tests of a contract suite on many engines in one process: `run_engines.py JOBS.json RESULTS.json [SUITE]`.

SUITE is `planners` or `families`. Jobs map what is under test (`module:Class`, or an engine) to tests
(`test_x.py::test_y`); results map it to tests to outcomes: a parametrised test has failed if one of its cases has.
"""

import gc
import json
import sys
from pathlib import Path

import pytest

import anysim.testing

SUITE = Path(anysim.testing.__file__).parent
_ORDER = ("skipped", "passed", "failed")


class Outcomes:
    """A pytest plugin that keeps the worst outcome per test."""

    def __init__(self) -> None:
        self.tests: dict[str, str] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Called by pytest for setup, call and teardown of each test."""
        if report.when != "call" and report.passed:
            return
        name = report.nodeid.rpartition("/")[2].partition("[")[0]
        before = self.tests.get(name, _ORDER[0])
        self.tests[name] = max(before, report.outcome, key=_ORDER.index)


def run(engine: str, tests: list[str], option: str = "--engine", suite: Path = SUITE) -> dict[str, str]:
    """Outcomes of the tests on one engine."""
    outcomes = Outcomes()
    gc.freeze()  # pytest collects several times at its end, and would look at all that the runs before have loaded
    where = [f"{suite}/{test}" for test in tests]
    options = ["-q", "--no-header", "--tb=no", "-p", "no:cacheprovider", "--import-mode=importlib"]
    options += [
        "-W",
        "ignore::pytest.PytestAssertRewriteWarning",
    ]  # the suite is imported before pytest runs, by design
    pytest.main([*options, option, engine, *where], plugins=[outcomes])
    return outcomes.tests


if __name__ == "__main__":
    jobs, results = Path(sys.argv[1]), Path(sys.argv[2])
    word = next(iter(sys.argv[3:]), "")
    suites = {"planners": "--planner", "families": "--family"}
    kind = (suites[word], SUITE / word) if word else ("--engine", SUITE)
    results.write_text(
        json.dumps({name: run(name, tests, *kind) for name, tests in json.loads(jobs.read_text()).items()})
    )
