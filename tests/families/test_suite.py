"""The suite of families: it clears a right one on every engine, and finds each wrong one by the test named for it."""

import inspect
import re
from pathlib import Path

import pytest

from tests.contract.suite_runs import outcomes_of, run
from tests.families import matter, paddles

RIGHT = {"paddles:Paddle": "9 passed, 1 skipped", "matter:Lump": "9 passed, 1 skipped"}
WRONG = {
    name: module
    for module, right in ((paddles, paddles.Paddle), (matter, matter.Lump))
    for name, made in inspect.getmembers(module, inspect.isclass)
    if issubclass(made, right) and made is not right
}
SUITE = ("-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "--pyargs", "anysim.testing.families")


@pytest.mark.parametrize(
    "engine", ["mujoco", *(pytest.param(name, marks=pytest.mark.slow) for name in ("pybullet", "sapien"))]
)
@pytest.mark.parametrize("name", RIGHT)
def test_a_right_family_passes(name: str, engine: str, tmp_path: Path) -> None:
    done = run(*SUITE, "--family", f"tests.families.{name}", "--engine", engine, folder=tmp_path)
    assert done.returncode == 0, done.stdout[-4000:]
    assert re.search(rf"anysim contract: family .*{name} on {engine}: {RIGHT[name]}", done.stdout)


@pytest.mark.slow
def test_the_suite_is_of_one_family(tmp_path: Path) -> None:
    import anysim.testing.families as suite

    where = str(Path(str(suite.__file__)).parent / "test_family.py")
    done = run("-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", where, folder=tmp_path)
    assert done.returncode == pytest.ExitCode.USAGE_ERROR
    assert "this suite tests one family" in done.stdout + done.stderr


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, str]]:
    """Of all wrong families, in one process."""
    found = dict[str, dict[str, str]]()
    for module in (paddles, matter):
        names = [name for name, where in WRONG.items() if where is module]
        jobs = {name: [f"test_family.py::{inspect.getdoc(getattr(module, name))}"] for name in names}
        found |= outcomes_of("families", module.__name__, jobs, tmp_path_factory.mktemp("wrong"))
    return found


@pytest.mark.slow
@pytest.mark.xdist_group("wrong families")
@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_family_is_found(name: str, outcomes: dict[str, dict[str, str]]) -> None:
    assert outcomes[name]
    assert set(outcomes[name].values()) == {"failed"}, outcomes[name]
