"""One home for the distributions of a spec: every kind has a nominal value, quantiles, written values and extremes."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from anysim.errors import Issues, SpecError
from anysim.model.appearance import COLORS, nominal_rgb
from anysim.randomization.distributions import draw_one, extremes, nominal, quantile, weighted, written
from anysim_schemas.values import Choice, LogUniform, Normal, NormalParameters, Range

KINDS: Mapping[str, tuple[Any, Any, tuple[Any, ...], tuple[float, float]]] = {
    "constant": (0.3, 0.3, (0.3,), (0.3, 0.3)),
    "range": (Range(range=(1.0, 3.0)), 2.0, (1.0, 3.0), (1.0, 3.0)),
    "whole": (Range(range=(2, 5)), 3, (2, 5), (2.0, 5.0)),
    "log_uniform": (LogUniform(log_uniform=(0.1, 10.0)), 1.0, (0.1, 10.0), (0.1, 10.0)),
    "choice": (Choice(choice=(4.0, 1.0, 2.0)), 4.0, (4.0, 1.0, 2.0), (1.0, 4.0)),
    "normal": (Normal(normal=NormalParameters(mean=1.0, std=0.5, low=1.2)), 1.2, (), (1.0, 1.2)),
    "gated": (Range(range=(1.0, 3.0), ratio=0.5, otherwise=9.0), 9.0, (1.0, 3.0, 9.0), (1.0, 9.0)),
}


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_known_of_a_distribution(kind: str) -> None:
    value, middle, said, ends = KINDS[kind]
    assert nominal(value) == pytest.approx(middle)
    assert written(value) == said
    assert extremes(value) == ends


@pytest.mark.parametrize("kind", ["range", "log_uniform", "normal"])
def test_a_quantile_is_what_that_share_of_the_draws_stays_below(kind: str) -> None:
    value, rng = KINDS[kind][0], np.random.default_rng(0)
    drawn = np.array([draw_one(value, rng.random) for _ in range(20000)])
    for share in (0.7, 0.95):
        assert np.mean(drawn < quantile(value, share)) == pytest.approx(share, abs=0.02)


def test_weights_say_how_often_an_index_comes() -> None:
    shares = (np.arange(1000) + 0.5) / 1000
    assert np.bincount([weighted((1.0, 0.0, 3.0), u) for u in shares]).tolist() == [250, 0, 750]
    assert weighted((0.1, 0.2), 1.0 - 2.0**-53) == 1


def test_a_colour_of_the_other_episodes_is_checked_and_is_the_nominal_one() -> None:
    """What a `ratio` leaves out has `otherwise`, of which a wrong name must not come up only in a reset."""
    issues = Issues("world")
    gated = Choice(choice=("red", "green"), ratio=0.5, otherwise="blue")
    assert nominal_rgb(gated, (0.0, 0.0, 0.0), issues) == COLORS["blue"]
    issues.raise_if_any()
    assert nominal_rgb(gated.model_copy(update={"otherwise": "blu"}), (0.5, 0.5, 0.5), issues) == (0.5, 0.5, 0.5)
    with pytest.raises(SpecError, match="did you mean 'blue'"):
        issues.raise_if_any()
