"""The benchmark of worker processes."""

import pytest
from typer.testing import CliRunner

from anysim.errors import EngineError
from anysim_bench.cli.bench import app
from anysim_bench.shards import shard_gains


@pytest.mark.slow
def test_gains_are_ratios_to_the_first():
    first, second = shard_gains("null", 4, [1, 2], rounds=2)
    assert (first.shards, first.num_envs, first.ratio, first.cpu_ratio) == (1, 4, 1.0, 1.0)
    assert second.shards == 2
    assert second.ratio == pytest.approx(second.rate / first.rate)
    assert second.cpu_ratio > 0.0


@pytest.mark.parametrize("shards", [[1, 5], [0]])
def test_shards_without_envs_are_refused(shards):
    with pytest.raises(EngineError, match="1 to 4 expected"):
        shard_gains("null", 4, shards)


def test_numbers_are_wanted():
    done = CliRunner().invoke(app, ["shards", "--shards", "1,two"])
    assert done.exit_code
    assert "whole numbers" in str(done.exception) + done.output
