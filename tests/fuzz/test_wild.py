"""Model, scene and mesh files in hostile folders: 20,000, in chunks; a few of each hundred in the fast tier.

`pytest tests/fuzz/test_wild.py -m full -s -k 7-` runs one chunk of a thousand; `Wild(folder).attempt(1234)` makes one.
"""

import time
from collections.abc import Iterator

import pytest

from tests.fuzz.budget import SECONDS, Tally
from tests.fuzz.wild import Wild

COUNT, CHUNK, FEW = 20_000, 1000, 120


@pytest.fixture(scope="module")
def wild(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Wild]:
    """The folder; its hook stays with the process and notes nothing where no input runs."""
    around = tmp_path_factory.mktemp("wild")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ANYSIM_CACHE_DIR", str(around / "cache"))
        made = Wild(around)
        yield made
        made.opened.watching = False


def run(wild: Wild, numbers: range) -> Tally:
    """The inputs of these numbers."""
    tally = Tally("model, scene and mesh files")
    for number in numbers:
        faults, began = len(tally.faults), time.process_time()
        tally.run(f"wild {number}", wild.attempt(number))
        slow = len(tally.faults) > faults and "took more than" in tally.faults[-1]
        if slow and time.process_time() - began < SECONDS:  # it waited, perhaps for other processes: once more
            tally.faults.pop()
            tally.inputs -= 1
            tally.run(f"wild {number}", wild.attempt(number))
    return tally


def test_a_few_hostile_folders(wild: Wild) -> None:
    """Every so manyth of the whole."""
    numbers = range(0, COUNT, COUNT // FEW)
    tally = run(wild, numbers)
    tally.passed(len(numbers))
    assert tally.accepted > FEW // 10  # else nothing but the parsers of XML is tried
    assert tally.refused > FEW // 10


@pytest.mark.full
@pytest.mark.parametrize("chunk", [f"{number}-" for number in range(COUNT // CHUNK)])
def test_hostile_folders(chunk: str, wild: Wild) -> None:
    """Each is read or refused in a sentence, in 5 s and 1 GB, and nothing outside of the folder is read."""
    first = int(chunk[:-1]) * CHUNK
    tally = run(wild, range(first, first + CHUNK))
    tally.passed(CHUNK)
    assert tally.accepted > CHUNK // 10
    assert tally.refused > CHUNK // 10
