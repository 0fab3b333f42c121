"""YAML documents, from the schema and hostile: each is checked as `anysim check` does, and some of the good are run."""

import warnings
from pathlib import Path

import numpy as np
import pytest

import anysim
from anysim.errors import AnysimError
from anysim_inspect.cli.check import report_on
from tests.fuzz.budget import Tally
from tests.fuzz.documents import TEXTS, Dice, Documents

COUNT, SEED = 20_000, 12
BUILT = 0.04
"""The share of the good documents that are built and run for two steps."""


class FaultsFoundError(AnysimError):
    """What `anysim check` finds, as an error."""


def check(path: Path, build: bool) -> None:
    report = report_on(str(path), None, False, [])
    if report.faults:
        assert all(report.faults), "a fault without a word"
        raise FaultsFoundError("\n".join(report.faults))
    if build:
        run(path)


def run(path: Path) -> None:
    """Two control steps of two envs."""
    with anysim.make(path, num_envs=2) as env:
        env.reset(seed=1)
        for _ in range(2):
            env.step(np.zeros((2, env.action_dim)), env.running)


def fuzz(count: int, seed: int, folder: Path) -> Tally:
    """Try documents; those at fault are left in the folder."""
    documents, share = Documents(seed), Dice(seed)
    tally, path = Tally("YAML documents"), folder / "world.yaml"
    for number in range(count):
        text, how = documents.text()
        path.write_bytes(text.encode("utf-8", "surrogatepass"))
        build = share.random() < BUILT and "task:" in text
        before = len(tally.faults)
        tally.run(f"{number}: {how}", lambda build=build: check(path, build))
        if len(tally.faults) > before:
            (folder / f"fault-{number}.yaml").write_bytes(path.read_bytes())
    return tally


def read_tasks(folder: Path) -> None:
    """Have the meshes of the tasks that documents extend in the cache: seconds that no document is to blame for."""
    path = folder / "task.yaml"
    for name in (text for text in TEXTS if text.startswith("task:")):
        path.write_text(f"extends: [{name}]\n")
        assert not report_on(str(path), None, False, []).faults


@pytest.mark.full
def test_hostile_documents_end_in_a_sentence(tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what a world is warned, not of how it is read
        read_tasks(tmp_path)
        fuzz(COUNT, SEED, tmp_path).passed(COUNT)


def test_a_hundred_documents(tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        tally = fuzz(100, SEED + 1, tmp_path)
    tally.passed(100)
    assert min(tally.accepted, tally.refused) >= 4, tally.report  # draws move with every key of the schema
