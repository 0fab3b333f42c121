"""Rules of every test: markers, a cache of its own, and nothing left behind."""

import gc
import multiprocessing
import os
import threading
import time
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import HealthCheck, settings

from anysim import threads as shared_threads

if TYPE_CHECKING:
    from typer import Typer

    from anysim.assets.model import ImportedModel
    from anysim.model.world import World

ROOT = Path(__file__).parents[1]
OWN_LEFTOVERS = frozenset({".pytest_cache", ".hypothesis", ".cache", ".ruff_cache", "__pycache__"})


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--minutes`, for runs that have to end, whatever the machine."""
    words = "skip the tests that have not begun after so many minutes"
    parser.addoption("--minutes", type=float, default=float("inf"), help=words)


def pytest_configure(config: pytest.Config) -> None:
    """Register the markers, and keep assets that tests prepare away from the user's cache.

    The cache is shared by all tests and kept between runs: its entries are named by the hash of their content. It is an
    environment variable so that processes that a test starts use it too.
    """
    config.stash[_BEGUN] = time.monotonic()
    config.addinivalue_line("markers", "slow: takes many seconds; `make test` leaves it out, `make test-slow` runs it")
    config.addinivalue_line("markers", "full: takes minutes and rarely finds more; only `make test-full` runs it")
    os.environ["ANYSIM_CACHE_DIR"] = str(ROOT / ".cache" / "tests")
    # how long a busy machine takes for an example, or to draw it, is no fault of what is tested
    settings.register_profile("untimed", deadline=None, suppress_health_check=[HealthCheck.too_slow])
    settings.load_profile("untimed")


COMPILING = (
    "plugins/sensors/test_batching.py::test_an_envs_bits_do_not_depend_on_the_batch_or_on_threads[rays-60]",
    "plugins/particles/test_category.py::test_particles_are_a_category_of_which_each_env_has_its_own_number",
    "plugins/sensors/test_camera.py::test_depth_and_segmentation_are_those_of_the_reference",
    "plugins/tactile/test_touch.py::test_sums_are_the_engines_force_and_moment[ball-mujoco]",
    "plugins/sensors/test_batching.py::test_an_envs_bits_do_not_depend_on_the_batch_or_on_threads[distances-60]",
    "plugins/sensors/test_camera.py::test_flow_is_where_points_have_come_from",
    "plugins/particles/test_exchange.py::test_a_body_of_joints_moves_matter_and_feels_it",
    "plugins/tactile/test_touch.py::test_promises[pad]",
    "plugins/sensors/test_declared.py::test_they_keep_their_promises[ring]",
)
"""Tests for which numba compiles most of the kernels in a new checkout, each of them other ones."""


LONGEST = "tests/tasks/test_experts.py"
"""Its tests take longest: as the last ones of a run they would leave one worker alone with them."""


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """What is imported meanwhile stays: nothing is looked for that could be freed."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> Generator[None, object, object]:
    """Those that compile go first, one to each worker: what is compiled is there for all that comes after."""
    found = config.stash.setdefault(_COLLECTED, set())
    for item in items:  # those of other tiers too, which are left out below
        name = getattr(item, "originalname", item.name)
        found.add((item.location[0], name, frozenset(mark.name for mark in item.iter_markers())))
    result = yield
    turn = {f"tests/{name}": number for number, name in enumerate(COMPILING)}
    late = len(turn)
    items.sort(key=lambda item: turn.get(item.nodeid, late + (not item.nodeid.startswith(LONGEST))))
    return result


@pytest.hookimpl(trylast=True)
def pytest_collection_finish() -> None:
    """Ten thousand tests live until the end: each full collection that an engine asks for would go through them."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Note the files of the working directory before a test."""
    item.stash[_BEFORE] = _listing()
    return (yield)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip what comes too late."""
    minutes = float(item.config.option.minutes)
    if time.monotonic() - item.config.stash[_BEGUN] > 60.0 * minutes:
        pytest.skip(f"the {minutes:g} minutes that were given are over")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item) -> Generator[None, None, None]:
    """A test that leaves a file in the working directory fails: libraries drop logs there when something is wrong."""
    yield
    left = sorted(_listing() - item.stash[_BEFORE] - OWN_LEFTOVERS)
    if left:
        pytest.fail(f"the test left {', '.join(left)} in {Path.cwd()}; write to tmp_path", pytrace=False)


_BEGUN = pytest.StashKey[float]()
_BEFORE = pytest.StashKey[frozenset[str]]()
_COLLECTED = pytest.StashKey[set[tuple[str, str, frozenset[str]]]]()


@pytest.fixture(scope="session")
def marks_of_tests(pytestconfig: pytest.Config) -> frozenset[tuple[str, str, frozenset[str]]]:
    """File, name and marks of each test that this session has found, run or not."""
    return frozenset(pytestconfig.stash[_COLLECTED])


def _listing() -> frozenset[str]:
    """Of environments nothing is told: `make test-rlds` may make one while the tests of another one run."""
    return frozenset(path.name for path in Path.cwd().iterdir() if not path.name.startswith(".venv"))


@pytest.fixture(scope="session", autouse=True)
def _nothing_runs_on() -> Iterator[None]:
    """At the end of the session no thread and no worker process of a test is alive."""
    yield
    others = [t for t in threading.enumerate() if t is not threading.main_thread() and not t.daemon]
    threads = [t.name for t in others if not t.name.startswith(shared_threads.NAME)]
    processes = [f"{p.name} ({p.pid})" for p in multiprocessing.active_children()]
    assert not threads, f"threads that no test stopped: {', '.join(threads)}"
    assert not processes, f"processes that no test stopped: {', '.join(processes)}"


@pytest.fixture(scope="session")
def command_line() -> "Typer":
    """The application as users have it: with the commands of plugins."""
    from anysim import hooks
    from anysim.cli.main import app

    if not any(command.name == "run" for command in app.registered_commands):
        hooks.add_commands(app)
    return app


INERTIAL = '<inertial><mass value="{m}"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>'


@pytest.fixture
def inertial() -> Callable[[float], str]:
    """The text of an inertial of some mass."""
    return lambda mass: INERTIAL.format(m=mass)


@pytest.fixture
def urdf(tmp_path: Path) -> "Callable[..., ImportedModel]":
    """Imports the body of a <robot> element from a file in tmp_path."""

    from anysim_urdf.load import import_urdf

    def load(body: str, **options: Any) -> "ImportedModel":
        path = tmp_path / "arm.urdf"
        path.write_text(f'<?xml version="1.0"?>\n<robot name="arm">\n{body}\n</robot>\n')
        return import_urdf(path, root=tmp_path, **options)

    return load


@pytest.fixture
def world() -> "Callable[..., World]":
    """Compiles a world given as plain data."""

    from anysim.compile.world import compile_world
    from anysim_schemas.run import WorldSpec

    def make(base: Path | None = None, **content: Any) -> "World":
        return compile_world(WorldSpec.model_validate(content), base=base)

    return make


@pytest.fixture(scope="session")
def panda() -> "World":
    """A world with the catalogue's Panda alone."""
    from anysim.compile.world import compile_world
    from anysim_schemas.run import WorldSpec

    return compile_world(WorldSpec.model_validate({"robots": {"panda": {"robot": "franka_panda"}}}))
