"""Rank agreement against examples worked by hand."""

import pytest
from scipy.stats import kendalltau, pearsonr

from anysim_evaluation.benchmark.ranks import kendall, mean_interval, mmrv, mmrv_tolerant, pearson


def test_kendalls_tau_heeds_ties() -> None:
    # pairs: 12 agree, 13 agree, 14 tie in b, 23 disagree, 24 disagree, 34 disagree
    a, b = [0.0, 0.2, 0.5, 0.9], [0.1, 0.8, 0.6, 0.1]
    assert kendall(a, b) == pytest.approx((2 - 3) / (6 * 5) ** 0.5)
    assert kendall(a, b) == pytest.approx(kendalltau(a, b).statistic)
    assert kendall(a, a) == 1.0
    assert kendall(a, [0.5] * 4) is None


def test_pearson() -> None:
    # centred (-1, 0, 1) and (-1, 1, 0): 1 / 2
    assert pearson([0.0, 1.0, 2.0], [1.0, 3.0, 2.0]) == pytest.approx(0.5)
    assert pearson([0.1, 0.4, 0.7], [0.3, 0.1, 0.9]) == pytest.approx(pearsonr([0.1, 0.4, 0.7], [0.3, 0.1, 0.9])[0])
    assert pearson([0.3, 0.3, 0.3], [0.0, 1.0, 0.5]) is None


def test_mmrv_both_ways() -> None:
    # policies A, B, C; the reference says C over B over A, the other engine A over C over B
    reference, rates = [0.1, 0.4, 0.9], [0.8, 0.2, 0.5]
    # by the reference: A is wrong about B (0.3) and C (0.8), B about A (0.3), C about A (0.8)
    assert mmrv(rates, reference) == pytest.approx((0.8 + 0.3 + 0.8) / 3)
    # the other way round: A about B (0.6) and C (0.3), B about A (0.6), C about A (0.3)
    assert mmrv(reference, rates) == pytest.approx((0.6 + 0.6 + 0.3) / 3)
    assert mmrv(rates, rates) == 0.0
    # the reference puts 2 over 1, the other engine ties them: 2 is wrong about 1, 1 is not about 2
    assert mmrv([0.5, 0.5], [0.2, 0.6]) == pytest.approx((0.0 + 0.4) / 2)
    assert mmrv([0.2, 0.6], [0.5, 0.5]) == 0.0


def test_a_tolerant_violation_is_one_that_both_are_sure_of() -> None:
    reference, rates = [0.1, 0.9], [0.6, 0.4]
    apart = [(0.0, 0.2), (0.8, 1.0)]
    assert mmrv_tolerant(rates, reference, [(0.55, 0.65), (0.35, 0.45)], apart) == pytest.approx(0.8)
    assert mmrv_tolerant(rates, reference, [(0.3, 0.8), (0.2, 0.6)], apart) == 0.0


def test_the_interval_of_a_mean_draws_tasks() -> None:
    low, high = mean_interval([1.0] * 6 + [0.0] * 6)
    assert (low, high) == mean_interval([1.0] * 6 + [0.0] * 6)
    assert low == pytest.approx(0.5 - 0.28, abs=0.06)  # 1.96 * 0.5 / sqrt(12)
    assert high == pytest.approx(0.5 + 0.28, abs=0.06)
    assert mean_interval([0.4] * 5) == pytest.approx((0.4, 0.4))
