"""The page of promises: the tests that it names exist, and the commands of a row run all tests that the row names."""

import json
import re
import shlex
import subprocess
import sys
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import pytest

pytestmark = pytest.mark.xdist_group("promises")  # one worker collects, once, for all tests

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "promises.md"
COMMAND = re.compile(r"`((?:make test|\.venv/bin/python )[^`]*)`")
PROOF = re.compile(r"\[([\w.]+)\]\(\.\./(tests/[\w/]+\.py)\): ((?:`test_\w+`(?:, )?)+)")
WHICH = {"": "default slow full", "full": "full", "slow and not full": "slow", "not slow and not full": "default"}
"""The tiers that an expression of marks selects."""
COLLECT = """
import json, sys, pytest
class Collected:
    def pytest_collection_finish(self, session):
        print()
        for item in session.items:
            names = [mark.name for mark in item.iter_markers()]
            print(json.dumps([item.location[0], item.originalname, names]))
pytest.main(["--collect-only", "-q", "-p", "no:cacheprovider", *sys.argv[1:]], plugins=[Collected()])
"""


class Row(NamedTuple):
    """A promise, the tests that it names as (file, test), and the commands beside them."""

    promise: str
    proofs: tuple[tuple[str, str], ...]
    commands: tuple[str, ...]


class Command(NamedTuple):
    """What a command of pytest runs: files, folders or modules, and the tiers."""

    paths: tuple[str, ...]
    tiers: frozenset[str]


def rows() -> list[Row]:
    """The rows of the tables of promises."""
    found: list[Row] = []
    lines = PAGE.read_text().partition("## Determinism")[2].splitlines()
    for line in lines:
        if line.startswith("| ") and not line.startswith("| promise |"):
            promise, _, tests, commands = (cell.strip() for cell in line.strip("|").split("|"))
            proofs = [(m[2], name) for m in PROOF.finditer(tests) for name in re.findall(r"`(\w+)`", m[3])]
            found.append(Row(promise, tuple(proofs), tuple(COMMAND.findall(commands))))
    return found


ROWS = rows()
TARGETS = dict(
    re.findall(
        r"^(test[\w-]*): .*\n\t\$\(PYTEST\)(?: -m \"([^\"]*)\")? \$\(ARGS\)$",
        (ROOT / "Makefile").read_text(),
        re.MULTILINE,
    )
)


def understood(command: str) -> Command:
    """What a command of the page asks for."""
    words = shlex.split(command)
    if words[0] == "make":
        marks = TARGETS[words[1]]
        rest = [word for more in words[2:] for word in shlex.split(more.removeprefix("ARGS="))]
    else:
        assert words[:3] == [".venv/bin/python", "-m", "pytest"], command
        marks, rest = "", words[3:]
    paths: list[str] = []
    ahead = iter(rest)
    for word in ahead:
        if word == "-m":
            marks = next(ahead)
        elif word == "--engine":
            next(ahead)
        elif word not in ("-s", "--pyargs"):
            assert not word.startswith("-"), f"{command}: this test does not know {word}"
            paths.append(word)
    return Command(tuple(paths), frozenset(WHICH[marks].split()))


@pytest.fixture(scope="module")
def collected(marks_of_tests: frozenset[tuple[str, str, frozenset[str]]]) -> Mapping[tuple[str, str], frozenset[str]]:
    """The tiers of each test in the files that the page names: parameters of one may differ.

    A session of all tests has found them; where it is of some of them, a process of its own looks for them.
    """
    files = sorted({file for row in ROWS for file, _ in row.proofs})
    rows = list(marks_of_tests)
    if not {*files} <= {file for file, _, _ in rows}:
        command = [sys.executable, "-c", COLLECT, *files]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
        assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
        lines = [json.loads(line) for line in done.stdout.splitlines() if line.startswith('["')]
        rows = [(file, name, frozenset(marks)) for file, name, marks in lines]
    found: dict[tuple[str, str], set[str]] = {}
    for file, name, marks in rows:
        tier = "full" if "full" in marks else "slow" if "slow" in marks else "default"
        found.setdefault((file, name), set()).add(tier)
    return {test: frozenset(tiers) for test, tiers in found.items()}


def test_the_page_has_promises() -> None:
    assert len(ROWS) > 30
    assert set(TARGETS) == {"test", "test-slow", "test-full"}


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.promise[:50])
def test_a_promise_has_tests_and_the_commands_that_run_all_of_them(
    row: Row, collected: Mapping[tuple[str, str], frozenset[str]]
) -> None:
    assert row.promise.endswith(".")
    assert row.proofs, "a promise without a test"
    commands = [understood(command) for command in row.commands]
    wanted = {(file, name, tier) for file, name in row.proofs for tier in _tiers(collected, file, name)}
    run = [{one for one in wanted if one[0] in command.paths and one[2] in command.tiers} for command in commands]
    assert set().union(*run) == wanted, "commands leave out, or do not run in their tier, a test that is named"
    for command, text, tests in zip(commands, row.commands, run, strict=True):
        assert {file for file, _, _ in tests} == set(command.paths), f"{text} names a file without a test of this row"
        assert {tier for _, _, tier in tests} == command.tiers, f"{text} runs a tier in which this row has no test"


def _tiers(collected: Mapping[tuple[str, str], frozenset[str]], file: str, name: str) -> frozenset[str]:
    assert (file, name) in collected, f"{file} has no test {name}"
    return collected[file, name]


def test_everything_that_looks_like_a_test_or_a_command_is_checked() -> None:
    """A link, a name or a command that is not of the usual form would be passed over."""
    text = PAGE.read_text()
    proofs = [proof for row in ROWS for proof in row.proofs]
    assert len(re.findall(r"`test_\w+`", text)) == len(proofs)
    assert set(re.findall(r"\]\(\.\./(tests/[^)]+)\)", text)) == {file for file, _ in proofs}
    for name, file in re.findall(r"\[([^]]+)\]\(\.\./(tests/[^)]+)\)", text):
        assert Path(file).name == name
    assert len(re.findall(r"`[^`]*(?:make test|pytest)[^`]*`", text)) == len(COMMAND.findall(text))


@pytest.mark.parametrize("command", sorted(set(COMMAND.findall(PAGE.read_text()))))
def test_what_a_command_names_exists(command: str) -> None:
    for path in understood(command).paths:
        assert find_spec(path) if "--pyargs" in command else (ROOT / path).exists(), path
