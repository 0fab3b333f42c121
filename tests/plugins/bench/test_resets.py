"""Nothing accumulates in resets that change what is present; and the benchmark would see it if it did."""

import pytest
from typer.testing import CliRunner

from anysim.engine.capability import Capability
from anysim.engine.factory import runnable
from anysim.errors import EngineError
from anysim.testing.engines import require_engine
from anysim_bench.cli.bench import app
from anysim_bench.resets import Sample, changing_world, growth, reset_cost

RESETS = 300


def _sample(resets, **changes):
    held = {"memory_mib": 100.0, "descriptors": 6, "threads": 1, "handles": {"clients": 4, "bodies": 40}}
    return Sample(resets, **(held | changes))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["null", "mujoco", "pybullet", "sapien"])
def test_nothing_grows(name):
    """Files, threads and handles stay; memory grows by less than the bound, after caches of bounded size are full."""
    require_engine(name)
    cost = reset_cost(name, RESETS, 3)
    assert [what for what in cost.grown if not what.startswith("time")] == [], cost.samples
    assert cost.samples[-1].resets == RESETS
    assert len(cost.samples) == 11


def test_the_verdict_names_what_grew():
    world = changing_world()
    flat = [_sample(100 * i) for i in range(11)]
    assert growth(flat, 1.0, 1.1, world, 4) == ()
    last = _sample(1000, memory_mib=150.0, descriptors=9, threads=2, handles={"clients": 5, "bodies": 90})
    assert growth([*flat[:-1], last], 1.0, 2.0, world, 4) == (
        "memory by 50 MiB",
        "descriptors from 6 to 9",
        "threads from 1 to 2",
        "clients from 4 to 5",
        "time per reset from 1.00 to 2.00 ms",
    )
    heap = _sample(1000, handles={"clients": 4, "bodies": 10_000})
    assert growth([*flat[:-1], heap], 1.0, 1.0, world, 4) == ("bodies from 40 to 10000",)


def test_too_few_resets_are_refused():
    with pytest.raises(EngineError, match="at least 20, got 5"):
        reset_cost("null", 5)


@pytest.mark.slow
def test_the_command_prints_a_verdict():
    assert "null" in runnable(Capability.VARYING_ENTITIES)
    done = CliRunner().invoke(app, ["resets", "--engine", "null", "--resets", "40", "-n", "2"])
    assert done.exit_code in (0, 1), done.output  # so few resets say little about time
    assert "P2" in done.output
    assert "same" in done.output
