"""Every example runs, and every block of Python in the docs."""

import re
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest
import yaml

from anysim.testing.engines import require_drawing
from tests import forked

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "docs" / "examples").glob("[0-9]*.py"))
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


EXCERPT = re.compile(r"^```(\w+) (\S+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FENCE = re.compile(r"^```(\w+)$", re.MULTILINE)
EXTERNAL = ROOT / "tests" / "external"
SOURCES = (*(EXTERNAL / f"anysim-{name}" for name in ("ballistic", "linkage", "thirdarm", "starter")), EXTERNAL, ROOT)
"""Folders in which the file at the head of an excerpt is looked for."""


def excerpts() -> list[tuple[str, str, str]]:
    return [
        (f"{page.relative_to(ROOT)}:{text[: m.start()].count(chr(10)) + 1}", m[2], m[3])
        for page in PAGES
        for text in [page.read_text()]
        for m in EXCERPT.finditer(text)
    ]


def blocks(language: str) -> list[tuple[str, str]]:
    return [
        (f"{page.relative_to(ROOT)}:{text[: m.start()].count(chr(10)) + 1}", m[2])
        for page in PAGES
        for text in [page.read_text()]
        for m in BLOCK.finditer(text)
        if m[1] == language
    ]


def run(arguments: list[str], cwd: Path) -> None:
    result = forked.run(*arguments, cwd=cwd)
    if result.returncode and "cannot draw here" in result.stderr:
        for engine in ("mujoco", "sapien"):
            require_drawing(engine)
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.name)
def test_an_example_runs(path: Path, tmp_path: Path) -> None:
    run([str(path)], tmp_path)


LONG = {f"docs/{name}.md" for name in ("agents", "banks", "counterfactuals", "fields", "navigation")}
"""Pages with a block that takes three seconds or more: theirs are run in the slow tier."""


@pytest.mark.parametrize(
    ("where", "code"),
    [
        pytest.param(where, code, marks=[pytest.mark.slow] if where.partition(":")[0] in LONG else [])
        for where, code in blocks("python")
    ],
    ids=lambda v: v if ":" in v[:60] and "\n" not in v else "code",
)
def test_a_block_of_python_runs(where: str, code: str, tmp_path: Path) -> None:
    run(["-c", code], tmp_path)


@pytest.mark.parametrize(
    ("where", "code"), blocks("yaml"), ids=lambda v: v if ":" in v[:60] and "\n" not in v else "code"
)
def test_a_block_of_yaml_checks(where: str, code: str, tmp_path: Path) -> None:
    from anysim_inspect.cli.check import report_on

    path = tmp_path / "block.yaml"
    path.write_text(code)
    assert yaml.safe_load(code)
    assert report_on(str(path), engine=None, all_engines=False, overrides=[]).faults == []


@pytest.mark.parametrize("path", sorted((ROOT / "docs" / "examples").glob("*.yaml")), ids=lambda p: p.name)
def test_an_example_of_a_world_checks(path: Path) -> None:
    from anysim_inspect.cli.check import report_on

    assert report_on(str(path), engine=None, all_engines=False, overrides=[]).faults == []


@pytest.mark.full
@pytest.mark.skipif(
    find_spec("stable_baselines3") is None, reason="the example needs stable-baselines3: make test-learning"
)
def test_the_example_with_stable_baselines_trains(tmp_path: Path) -> None:
    run([str(ROOT / "docs" / "examples" / "train_with_sb3.py")], tmp_path)


def _words(text: str) -> str:
    """Lines without indentation and blank ones: `make format` sets those of a block as if it were a file."""
    return "".join(f"\n{line.strip()}" for line in text.splitlines() if line.strip()) + "\n"


@pytest.mark.parametrize(("where", "name", "code"), excerpts(), ids=lambda v: v if "\n" not in v else "code")
def test_an_excerpt_is_what_its_file_says(where: str, name: str, code: str) -> None:
    """Line by line, without gaps but where a line of three dots says so. The file itself is run by other tests."""
    text = next((root / name).read_text() for root in SOURCES if (root / name).is_file())
    rest = _words(text)
    for part in code.split("...\n"):
        _, found, rest = rest.partition(_words(part))
        assert found, f"{where}: not in {name}, or not in this order:\n{part}"


def test_every_block_is_run_or_taken_from_a_file() -> None:
    languages = {m[1] for page in PAGES for m in FENCE.finditer(page.read_text())}
    assert languages <= {"python", "yaml"}, "a block of another language needs the file that it is taken from"


def test_the_tests_that_the_guide_names_exist() -> None:
    suite = ROOT / "core" / "anysim" / "testing"
    known = set(re.findall(r"def (test_\w+)", "\n".join(path.read_text() for path in suite.glob("test_*.py"))))
    known |= {path.name for path in suite.glob("test_*.py")}
    named = set(re.findall(r"`(test_[\w.]+)`", (ROOT / "docs" / "write_an_engine.md").read_text()))
    assert len(named) > 20
    assert named <= known


def test_there_are_examples_and_blocks() -> None:
    assert len(EXAMPLES) >= 3
    assert len(blocks("python")) >= 5


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+?)(?:#[^)]*)?\)", page.read_text()):
        if "://" not in target:
            assert (page.parent / target).exists(), f"{page}: {target}"


def _table(marker: str) -> list[list[str]]:
    """The cells of a table of the guide that stands between a marker and the end."""
    text = (
        (ROOT / "docs" / "write_an_engine.md").read_text().partition(f"<!-- {marker} -->")[2].partition("<!-- end")[0]
    )
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]
    return rows[2:]


def test_the_fields_of_the_guide_are_those_of_the_state() -> None:
    """Names, and shapes in an engine that has all of them and in the words of `State`."""
    from anysim.engine.state import FIELDS, State
    from anysim.testing import worlds
    from anysim.testing.kinematic import NullEngine

    rows = {cells[0].strip("`"): cells[1] for cells in _table("fields of _read")}
    assert tuple(rows) == FIELDS
    with NullEngine() as engine:
        engine.create_world(worlds.scene(sensor=True), 3)
        world, state = engine.world, engine.get_state()
        sizes = {"N": 3, "B": len(world.bodies), "J": len(world.joints), "S": len(world.contact_sensors)}
        for name, shape in rows.items():
            numbers = [sizes[part] if part in sizes else int(part) for part in re.findall(r"\w+", shape)]
            assert list(getattr(state, name).shape) == numbers, name
            assert shape in str(getattr(State, name).__doc__), name


def test_the_helpers_of_the_guide_exist() -> None:
    rows = [*_table("helpers"), *_table("mechanics")]
    names = [name for cells in rows for name in re.findall(r"`(anysim(?:_mechanics)?\.[\w.]+)`", cells[0])]
    assert len(names) > 30
    for name in names:
        module, _, attribute = name.rpartition(".")
        assert find_spec(name) if name == "anysim.math.pose" else hasattr(import_module(module), attribute), name
