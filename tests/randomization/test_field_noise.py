"""Noise of sensors against its parameters: Allan deviations, and what it must not depend on.

The Allan deviation at an averaging time is half the mean square of the difference of neighbouring averages, rooted. Of
rows that are as many realisations it is known to a few percent; averaging times stay below a fortieth of the length.
"""

from math import exp, sqrt

import numpy as np
import pytest

from anysim.conventions import Array
from anysim.randomization.draw import FieldNoise
from anysim.randomization.streams import Streams
from anysim_schemas.sensors import SensorNoiseSpec

ENVS, SIZE, COUNT, PERIOD = 8, 16, 4000, 0.01


def errors(seed: int = 0, envs: int = ENVS, period: float = PERIOD, **keys: object) -> Array:
    """(COUNT, envs * SIZE) errors of readings."""
    streams = Streams(envs, seed)
    noise = FieldNoise(SensorNoiseSpec.model_validate(keys), "sensor/s/x", "x", streams, SIZE, period)
    ids = np.arange(envs)
    streams.begin(ids)
    noise.reset(ids)
    truth = np.zeros((envs, SIZE))
    return np.array([noise.added(truth, ids, np.full(envs, tick)).ravel() for tick in range(COUNT)])


def allan(values: Array, count: int) -> float:
    """Overlapping Allan deviation of averages of `count` values, over all columns."""
    sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    means = (sums[count:] - sums[:-count]) / count
    return float(np.sqrt(0.5 * np.mean((means[count:] - means[:-count]) ** 2)))


@pytest.mark.parametrize("count", [1, 5, 20, 100])
def test_white_noise_falls_with_the_root_of_time(white: Array, count: int) -> None:
    assert allan(white, count) == pytest.approx(0.02 / sqrt(count * PERIOD), rel=0.04)


@pytest.fixture(scope="module")
def white() -> Array:
    return errors(white=0.02)


@pytest.fixture(scope="module")
def walk() -> Array:
    return errors(walk=0.3)


@pytest.mark.parametrize("count", [10, 30, 100])
def test_a_walk_grows_with_the_root_of_time(walk: Array, count: int) -> None:
    """Of steps that are not small the discrete sum has 1 + 1/(2 count^2) of the variance of the continuous walk."""
    expected = 0.3 * sqrt(count * PERIOD / 3.0 * (1.0 + 0.5 / count**2))
    assert allan(walk, count) == pytest.approx(expected, rel=0.08)
    assert np.std(walk[count]) == pytest.approx(0.3 * sqrt(count * PERIOD), rel=0.2)  # of 128: 6 %, 3 sigma


def test_a_walk_that_forgets_levels_off() -> None:
    """Gauss-Markov: Allan deviation and standard deviation of the continuous process."""
    density, time = 0.3, 0.5
    values = errors(walk=density, walk_time=time)
    for count in (10, 50, 100):
        tau = count * PERIOD
        share = time / (2 * tau) * (3 - 4 * exp(-tau / time) + exp(-2 * tau / time))
        assert allan(values, count) == pytest.approx(density * time / sqrt(tau) * sqrt(1 - share), rel=0.05)
    assert np.std(values[COUNT // 2 :]) == pytest.approx(density * sqrt(time / 2), rel=0.05)


def test_densities_do_not_depend_on_the_rate() -> None:
    """Half the rate: each reading is an average of two, of the same densities."""
    fast, slow = errors(white=0.02, walk=0.05), errors(white=0.02, walk=0.05, period=2 * PERIOD)
    for count in (20, 40):
        assert allan(slow, count // 2) == pytest.approx(allan(fast, count), rel=0.08)


def test_a_bias_is_one_for_an_episode_and_another_for_each_number() -> None:
    values = errors(bias={"normal": {"mean": 0.0, "std": 2.0}})
    assert (values == values[0]).all()
    assert len(set(values[0].tolist())) == values.shape[1]
    assert np.std(values[0]) == pytest.approx(2.0, rel=0.2)


def test_an_env_has_the_same_noise_whatever_else_there_is() -> None:
    keys = {"noise": {"range": [-1.0, 1.0]}, "white": 0.1, "walk": 0.1, "bias": {"range": [-1.0, 1.0]}}
    many, one = errors(**keys), errors(envs=1, **keys)
    assert np.array_equal(many[:, :SIZE], one)
    assert not np.array_equal(many[:, :SIZE], many[:, SIZE : 2 * SIZE])
    assert not np.array_equal(errors(seed=1, envs=1, **keys), one)


def test_each_part_has_a_stream_of_its_own() -> None:
    """One part more moves none of the others."""
    parts = {"white": 0.1, "walk": 0.1, "bias": {"range": [-1.0, 1.0]}}
    apart = sum(errors(envs=1, **{key: value}) for key, value in parts.items())
    assert errors(envs=1, **parts) == pytest.approx(apart, abs=1e-12)
