"""Every example runs, and every block of Python in the docs."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "docs" / "examples").glob("[0-9]*.py"))
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(language: str) -> list[tuple[str, str]]:
    return [
        (f"{page.relative_to(ROOT)}:{text[: m.start()].count(chr(10)) + 1}", m[2])
        for page in PAGES
        for text in [page.read_text()]
        for m in BLOCK.finditer(text)
        if m[1] == language
    ]


def run(arguments: list[str], cwd: Path) -> None:
    result = subprocess.run(
        [sys.executable, *arguments], capture_output=True, text=True, timeout=300, cwd=cwd, check=False
    )
    if result.returncode and "cannot draw here" in result.stderr:
        pytest.skip(result.stderr.strip().splitlines()[-1])
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.name)
def test_an_example_runs(path: Path, tmp_path: Path) -> None:
    run([str(path)], tmp_path)


@pytest.mark.parametrize(
    ("where", "code"), blocks("python"), ids=lambda v: v if ":" in v[:60] and "\n" not in v else "code"
)
def test_a_block_of_python_runs(where: str, code: str, tmp_path: Path) -> None:
    run(["-c", code], tmp_path)


@pytest.mark.parametrize(
    ("where", "code"), blocks("yaml"), ids=lambda v: v if ":" in v[:60] and "\n" not in v else "code"
)
def test_a_block_of_yaml_checks(where: str, code: str, tmp_path: Path) -> None:
    from anysim.cli.check import check_one

    path = tmp_path / "block.yaml"
    path.write_text(code)
    assert yaml.safe_load(code)
    assert check_one(str(path), engine=None, all_engines=False, overrides=[]) == []


def test_there_are_examples_and_blocks() -> None:
    assert len(EXAMPLES) >= 3
    assert len(blocks("python")) >= 5


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+?)(?:#[^)]*)?\)", page.read_text()):
        if "://" not in target:
            assert (page.parent / target).exists(), f"{page}: {target}"
