"""The map of the code: every file and name in it exists, and the glossary is as long as it may be."""

import re
from importlib.util import find_spec
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
CORE = DOCS.parent / "core" / "anysim"
PAGE = (DOCS / "architecture.md").read_text()
ROWS = re.findall(r"^\| (.+\?) \| (.+) \| `(\w+)` \|$", PAGE, re.MULTILINE)
ORDER = re.findall(r"^\| (`\w+`(?:, `\w+`)*) \| [^|]+ \|$", PAGE, re.MULTILINE)
TERMS = re.findall(r"^\| ([\w ]+) \| .+ \| (`.+`) \|$", (DOCS / "glossary.md").read_text(), re.MULTILINE)


def test_the_order_of_imports_names_what_stands_in_core_and_nothing_else() -> None:
    named = [name for names in ORDER for name in re.findall(r"`(\w+)`", names)]
    modules = {path.stem for path in CORE.glob("*.py")} - {"__init__"}
    packages = {path.parent.name for path in CORE.glob("*/__init__.py")}
    assert sorted(named) == sorted(modules | packages)


def test_at_least_twenty_questions_are_answered() -> None:
    assert len(ROWS) >= 20


@pytest.mark.parametrize(("question", "where", "name"), ROWS, ids=[row[0] for row in ROWS])
def test_the_file_of_an_answer_defines_its_name(question: str, where: str, name: str) -> None:
    file = DOCS / re.findall(r"\]\(([^)]+)\)", where)[-1]
    assert re.search(rf"^(class|def) {name}\b", file.read_text(), re.MULTILINE), f"{question} {file} has no {name}"


def test_terms_have_homes_that_exist() -> None:
    assert 40 <= len(TERMS) <= 60
    assert [term for term, _ in TERMS] == sorted((term for term, _ in TERMS), key=str.lower)
    for term, homes in TERMS:
        for home in re.findall(r"`([\w/.]+)`", homes):
            module = home if home.startswith("anysim_") else "anysim." + home.replace("/", ".")
            assert find_spec(module) is not None, f"{term}: there is no module {module}"
