"""The suite of planners: it clears the right ones, and finds each wrong one by the test named for its defect."""

import inspect
import re
from pathlib import Path

import pytest

from tests.contract.suite_runs import outcomes_of, run
from tests.planning import wrong_planners

WRONG = [
    name
    for name, made in inspect.getmembers(wrong_planners, inspect.isclass)
    if made.__module__ == wrong_planners.__name__ and not name.startswith("_")
]
SUITE = ("-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "--pyargs", "anysim.testing.planners")


@pytest.mark.parametrize(
    "planner", ["rrt", *(pytest.param(name, marks=pytest.mark.slow) for name in ("roboplan", "rrt_topp_ra"))]
)
def test_a_right_planner_passes(planner: str, tmp_path: Path) -> None:
    if planner == "roboplan":
        pytest.importorskip("roboplan.rrt", reason="roboplan is an extra")
    done = run(*SUITE, "--planner", planner, folder=tmp_path)
    assert done.returncode == 0, done.stdout[-4000:]
    assert re.search(rf"anysim contract: planner {planner} 1.*: 32 passed, 0 skipped", done.stdout)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "cause"),
    [
        (("--planner", "numba_ik"), "it is no planner of motion"),
        (("--planner", "rt"), "no planner named 'rt'"),
        ((), "this suite tests one planner: pytest --pyargs anysim.testing.planners --planner NAME"),
    ],
)
def test_what_is_no_planner_is_told(words: tuple[str, ...], cause: str, tmp_path: Path) -> None:
    where = () if words else (str(Path(_suite()) / "test_paths.py"),)
    done = run("-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", *words, *where, folder=tmp_path)
    assert done.returncode == pytest.ExitCode.USAGE_ERROR
    assert cause in done.stdout + done.stderr


def _suite() -> str:
    import anysim.testing.planners as suite

    return str(Path(suite.__file__).parent)


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, str]]:
    """Of all wrong planners, in one process."""
    jobs = {name: inspect.getdoc(getattr(wrong_planners, name)).split() for name in WRONG}
    return outcomes_of("planners", wrong_planners.__name__, jobs, tmp_path_factory.mktemp("wrong"))


@pytest.mark.slow
@pytest.mark.xdist_group("wrong planners")
@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_planner_is_found(name: str, outcomes: dict[str, dict[str, str]]) -> None:
    assert outcomes[name]
    assert set(outcomes[name].values()) == {"failed"}, outcomes[name]
