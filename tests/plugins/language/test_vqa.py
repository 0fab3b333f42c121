"""Sets of questions in files: they go on where they were cut off, and say what is wrong with their arguments."""

import json
import shutil
from errno import ENOSPC
from pathlib import Path

import pytest

from anysim.errors import RecordError
from anysim_language import vqa
from anysim_language.vqa import PARTS, QUESTIONS_FILE, QuestionOrder, write_questions

FEW = QuestionOrder(moments=2, most=12, images=False, forks=False)


@pytest.fixture
def two(stacked: Path, tmp_path: Path) -> list[Path]:
    """The trajectory in two runs."""
    runs = [tmp_path / name / "episodes" / stacked.name for name in ("first", "second")]
    for run in runs:
        shutil.copytree(stacked, run)
    return runs


def test_a_call_that_was_cut_off_goes_on_and_writes_the_same(two: list[Path], tmp_path: Path) -> None:
    def killed(path: Path, count: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_questions(two, tmp_path / "cut", FEW, told=killed)
    assert not (tmp_path / "cut" / QUESTIONS_FILE).exists()
    cut = write_questions(two, tmp_path / "cut", FEW)
    whole = write_questions(two, tmp_path / "whole", FEW)
    assert (cut.resumed, whole.resumed) == (1, 0)
    assert cut.questions == whole.questions
    text = (tmp_path / "cut" / QUESTIONS_FILE).read_text()
    assert text == (tmp_path / "whole" / QUESTIONS_FILE).read_text()
    assert [json.loads(line)["trajectory"] for line in text.splitlines()[::12]] == [str(path) for path in two]


def test_what_was_asked_otherwise_or_is_damaged_is_asked_anew(two: list[Path], tmp_path: Path) -> None:
    out = tmp_path / "out"
    first = write_questions(two[:1], out, FEW)
    (part,) = (out / PARTS).glob("*.json")
    part.write_text(part.read_text()[:100])
    assert write_questions(two[:1], out, FEW)._replace(resumed=0) == first
    other = write_questions(two[:1], out, QuestionOrder(moments=2, most=5, images=False, forks=False))
    assert other.resumed == 0
    assert sum(other.questions.values()) == 5


def test_two_trajectories_of_one_name_are_refused(two: list[Path], tmp_path: Path) -> None:
    other = tmp_path / "elsewhere" / "first" / "episodes" / two[0].name
    shutil.copytree(two[0], other)
    with pytest.raises(RecordError, match="are of runs that are called the same"):
        write_questions([two[0], other], tmp_path / "out", FEW)


def test_a_file_in_place_of_the_directory_is_refused(two: list[Path], tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")
    with pytest.raises(RecordError, match="is no directory; --out is the directory"):
        write_questions(two, tmp_path / "out", FEW)


def test_a_full_disk_is_told_and_what_is_whole_is_used_again(
    two: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write, out = vqa._write, tmp_path / "out"

    def full(file: Path, text: str) -> None:
        if file.name.startswith("second"):
            raise OSError(ENOSPC, "No space left on device")
        write(file, text)

    with monkeypatch.context() as patch:
        patch.setattr(vqa, "_write", full)
        with pytest.raises(RecordError, match="cannot be written: No space left on device; make room"):
            write_questions(two, out, FEW)
    assert not (out / QUESTIONS_FILE).exists()
    assert write_questions(two, out, FEW).resumed == 1
