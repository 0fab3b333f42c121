"""Every broken file in `broken/` gives exactly the message beside it. ANYSIM_UPDATE_GOLDENS=1 writes them anew."""

import os
import sysconfig
from pathlib import Path

import pytest

from anysim import registry
from anysim.cli.check import check_one
from anysim.errors import listing

BROKEN = Path(__file__).parent / "broken"
FILES = sorted(BROKEN.glob("*.yaml"))


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_a_broken_file_gives_its_golden_message(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(BROKEN)
    faults = check_one(path.name, engine=None, all_engines=False, overrides=[])
    text = "".join(f"{fault}\n" for fault in faults)
    for place, word in (
        (sysconfig.get_paths()["purelib"], "<site-packages>"),
        (str(BROKEN), "<here>"),
        (str(BROKEN.parents[2]), "<root>"),
    ):
        text = text.replace(place, word)
    text = text.replace(", ".join(registry.names("engines")), "<engines>")  # which are installed differs
    text = text.replace(listing(registry.names("robots")), "<robots>")
    golden = path.with_suffix(".expected.txt")
    if os.environ.get("ANYSIM_UPDATE_GOLDENS"):
        golden.write_text(text)
    assert text == golden.read_text()
    assert text, "the file is not broken"


def test_there_are_enough_of_them() -> None:
    assert len(FILES) >= 12


def test_the_installed_task_has_no_faults() -> None:
    assert check_one("pick_cube", engine="mujoco", all_engines=False, overrides=[]) == []


def test_a_world_that_an_engine_cannot_run_is_refused_before_it_is_built() -> None:
    faults = check_one("pick_cube", engine="null", all_engines=False, overrides=[])
    assert len(faults) == 1
    assert "null cannot run pick_cube: camera 'front' gives rgb (render: rgb)" in faults[0]
