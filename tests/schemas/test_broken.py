"""Every file in broken/ is refused with exactly the text beside it.

A file may begin with comments that say how it is loaded: `# robot` for a robot's catalogue entry, `# -o KEY=VALUE` for
an override. After a wanted change of a message: ANYSIM_UPDATE_GOLDENS=1 pytest tests/schemas/test_broken.py, then read
the diff.
"""

import os
from pathlib import Path

import pytest

from anysim_schemas.errors import SpecError
from anysim_schemas.load import load
from anysim_schemas.robot_model import RobotModelSpec
from anysim_schemas.run import RunSpec

BROKEN = Path(__file__).parent / "broken"
FILES = sorted(BROKEN.glob("*.yaml"))
LEAKS = ("Input should", "Extra inputs", "Field required", "Value error", "validation error", "pydantic", "PyYAML")


def complaint(path: Path, resolver) -> str:
    header = [line[2:].strip() for line in path.read_text().splitlines() if line.startswith("# ")]
    model = RobotModelSpec if "robot" in header else RunSpec
    overrides = [line.removeprefix("-o ") for line in header if line.startswith("-o ")]
    with pytest.raises(SpecError) as caught:
        load(model, path.name, overrides=overrides, resolver=resolver)
    return f"{caught.value}\n"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_broken_file_is_refused_with_these_words(path, resolver, monkeypatch):
    monkeypatch.chdir(BROKEN)
    golden = path.with_suffix(".expected.txt")
    said = complaint(path, resolver)
    if os.environ.get("ANYSIM_UPDATE_GOLDENS"):
        golden.write_text(said, encoding="utf-8")
    assert said == golden.read_text(encoding="utf-8")
    assert not [leak for leak in LEAKS if leak in said]


def test_every_golden_has_its_file_and_there_are_enough():
    assert {path.stem for path in FILES} == {path.name.split(".")[0] for path in BROKEN.glob("*.expected.txt")}
    assert len(FILES) >= 22
