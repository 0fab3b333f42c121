"""Modules in a process of their own: what they printed comes back, and how they ended is words."""

from pathlib import Path

import pytest

from anysim_processes.own_process import ProcessEnd, how_it_ended, run_module


@pytest.fixture(autouse=True)
def modules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    for name, code in {
        "good": "import sys; print(sys.argv[1:])",
        "dies": "import os, signal; print('on its way', flush=True); os.kill(os.getpid(), signal.SIGSEGV)",
        "slow": "import time; print('begun', flush=True); time.sleep(600)",
        "wrong": "raise SystemExit('no')",
    }.items():
        (tmp_path / f"{name}.py").write_text(code, encoding="utf-8")


def test_a_module_gets_its_arguments_and_ends_well() -> None:
    assert run_module("good", "a", "b c", limit=60.0) == ProcessEnd("['a', 'b c']\n", "", "")


def test_a_crash_an_exit_code_and_a_hang_are_words() -> None:
    died = run_module("dies", limit=60.0)
    assert (died.out, died.trouble) == ("on its way\n", "was ended by signal 11 (SIGSEGV)")
    assert run_module("wrong", limit=60.0) == ProcessEnd("", "no\n", "ended with exit code 1")
    hung = run_module("slow", limit=3.0)
    assert (hung.out, hung.trouble) == ("begun\n", "took longer than 3 s and was stopped")


def test_unknown_signals_have_numbers() -> None:
    assert how_it_ended(0) == ""
    assert how_it_ended(-99) == "was ended by signal 99 (unknown)"
