"""A sensor of a stranger: found, read, noisy, late, recorded and replayed as ours are."""

import json
from pathlib import Path

import pytest

from tests.external_packages import FOUND, install, offered, run

READ = """
import sys
import numpy as np
import anysim
from anysim.testing.sensors import check_sensor

world = sys.argv[1]
check_sensor(world, "gauge")
quiet = ("world.sensors.gauge.noise={}", "world.sensors.gauge.delay=0")
with anysim.make(world, overrides=quiet) as env:
    env.reset(seed=0)
    slow = env.sensors.reading("gauge", "altitude")[0]
    assert abs(slow - 20.0) < 1e-6, slow
    for _ in range(40):
        env.step(np.zeros((1, 0)))
    height = env.obs["privileged"][0, 2]
    lag = env.sensors.reading("gauge", "altitude")[0] - height
    # a gauge that is read each T [s] and keeps exp(-T/lag) is v T k/(1-k) late, less what gravity adds meanwhile
    keeps = np.exp(-0.04 / 0.05)
    late = 0.04 * keeps / (1 - keeps)
    expected = 9.81 * 0.8 * late - 9.81 * late * (late + 0.02)
    assert abs(lag - expected) < 0.02, (lag, expected)
print("read")
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with anysim-barometer in it."""
    return install("anysim-barometer", tmp_path_factory.mktemp("site"))


@pytest.fixture
def world(site: Path) -> str:
    return str(site / "anysim_barometer" / "falling.yaml")


def test_all_that_it_offers_is_found_and_loads(site: Path) -> None:
    done = run(site, "-c", FOUND, "anysim-barometer")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == offered("anysim-barometer")


def test_it_reads_what_it_says_and_keeps_its_promises(site: Path, world: str) -> None:
    done = run(site, "-c", READ, world)
    assert done.stdout == "read\n", done.stderr[-3000:]


def test_its_parameters_are_checked_with_their_places(site: Path, world: str, tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(Path(world).read_text().replace("lag: 0.05", "lag: -1").replace("white: 0.2", "whit: 0.2"))
    done = run(site, "-m", "anysim.cli", "check", str(path))
    assert done.returncode == 1
    assert "wrong.yaml:11:12: world.sensors.gauge.lag: must be at least 0, got -1 (time constant" in done.stderr
    assert (
        "wrong.yaml:15:20: world.sensors.gauge.noise.pressure.whit: unknown key; did you mean 'white'?" in done.stderr
    )
