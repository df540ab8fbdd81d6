"""The report's intervals: known values, and what must hold of them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from lalliance_study.report import statistics


def _skewed(seed: int, count: int) -> tuple[statistics.Floats, statistics.Floats]:
    """Makespans of two contenders on the same missions: skewed, and alike where the mission is the same."""
    chance = np.random.default_rng(seed)
    mission = chance.lognormal(4.0, 0.6, count)
    return mission * chance.lognormal(0.1, 0.3, count), mission * chance.lognormal(0.0, 0.3, count)


def test_wilsons_interval_is_the_one_of_the_books() -> None:
    """0 of 10 and 10 of 10 are bounded, and 81 of 263 as in Newcombe (Statistics in Medicine 17, 1998, table I)."""
    assert statistics.proportion(0, 10) == pytest.approx((0.0, 0.0, 0.27753), abs=1e-5)
    assert statistics.proportion(10, 10) == pytest.approx((1.0, 0.72247, 1.0), abs=1e-5)
    assert statistics.proportion(81, 263) == pytest.approx((0.30798, 0.2553, 0.3662), abs=5e-5)


def test_a_share_of_nothing_is_no_number() -> None:
    assert all(math.isnan(end) for end in statistics.proportion(0, 0))


def test_a_mean_has_students_interval() -> None:
    assert statistics.mean(np.array([1.0, 2, 3, 4, 5])) == pytest.approx((3.0, 1.0368, 4.9632), abs=1e-4)


def test_one_mission_gives_a_value_and_no_interval() -> None:
    assert statistics.mean(np.array([7.0])).value == 7.0
    found = statistics.log_ratio(np.array([3.0]), np.array([2.0])).ratio()
    assert found.value == pytest.approx(1.5)
    assert math.isnan(found.low)
    assert math.isnan(statistics.pooled([[statistics.log_ratio(np.array([3.0]), np.array([2.0]))]]).ratio().low)


def test_the_interval_of_a_ratio_is_that_of_the_bootstrap() -> None:
    """On 200 skewed missions both ends agree with the bias-corrected bootstrap within a twentieth of the interval."""
    ours, theirs = _skewed(1, 200)
    found = statistics.log_ratio(ours, theirs).ratio()

    def ratio(a: statistics.Floats, b: statistics.Floats, axis: int) -> statistics.Floats:
        return np.asarray(a.mean(axis) / b.mean(axis))

    drawn = stats.bootstrap(
        (ours, theirs), ratio, paired=True, vectorized=True, n_resamples=9999, rng=np.random.default_rng(2)
    )
    wide = found.high - found.low
    assert found.low == pytest.approx(drawn.confidence_interval.low, abs=wide / 20)
    assert found.high == pytest.approx(drawn.confidence_interval.high, abs=wide / 20)


def test_the_interval_of_a_ratio_holds_the_truth_as_often_as_it_says() -> None:
    """In 95 % of 2,000 samples of 50 skewed missions, up to chance and what skew costs."""
    truth = math.exp(0.1)
    held = sum(not statistics.log_ratio(*_skewed(seed, 50)).ratio().apart_from(truth) for seed in range(2000))
    assert 0.93 <= held / 2000 <= 0.965


@given(seed=st.integers(0, 1000), factor=st.floats(0.1, 10))
def test_a_ratio_knows_no_unit_and_its_inverse_is_the_inverse(seed: int, factor: float) -> None:
    ours, theirs = _skewed(seed, 20)
    forth, back = statistics.log_ratio(ours, theirs).ratio(), statistics.log_ratio(theirs, ours).ratio()
    assert statistics.log_ratio(factor * ours, factor * theirs).ratio() == pytest.approx(forth)
    assert (1 / back.value, 1 / back.high, 1 / back.low) == pytest.approx(forth)


def test_equal_samples_have_a_ratio_of_exactly_one() -> None:
    ours, _ = _skewed(3, 20)
    alike = statistics.log_ratio(ours, ours)
    assert alike.ratio() == (1.0, 1.0, 1.0)
    assert statistics.pooled([[alike], [alike]]).ratio() == (1.0, 1.0, 1.0)


def test_pooled_scenarios_have_their_geometric_mean_and_a_smaller_error() -> None:
    parts = [statistics.log_ratio(*_skewed(seed, 100)) for seed in range(16)]
    found = statistics.pooled([[part] for part in parts])
    assert math.exp(found.value) == pytest.approx(float(stats.gmean([part.ratio().value for part in parts])))
    assert found.error == pytest.approx(math.sqrt(sum(part.error**2 for part in parts)) / 16)
    assert min(part.freedom for part in parts) <= found.freedom <= sum(part.freedom for part in parts)
    assert statistics.pooled([parts[:1]]).ratio() == pytest.approx(parts[0].ratio())


def test_ratios_of_the_same_missions_add_no_certainty() -> None:
    """The same ratio twice from the same missions is as sure as it is once; from others it is surer."""
    part = statistics.log_ratio(*_skewed(5, 100))
    assert statistics.pooled([[part, part]]) == pytest.approx(part)
    assert statistics.pooled([[part], [part]]).error == pytest.approx(part.error / math.sqrt(2))


def test_a_pooled_mean_of_one_scenario_is_its_mean() -> None:
    ours, theirs = _skewed(4, 30)
    assert statistics.pooled_mean([ours]) == pytest.approx(statistics.mean(ours))
    assert statistics.pooled_mean([ours, theirs]).value == pytest.approx((ours.mean() + theirs.mean()) / 2)


def test_a_quantile_lies_between_its_order_statistics() -> None:
    """The median of 1 to 20 lies between the 6th and the 15th value (Conover, Practical Nonparametric Statistics)."""
    assert statistics.quantile(np.arange(1.0, 21), 0.5) == (10.5, 6.0, 15.0)
    assert statistics.quantile(np.arange(1.0, 6), 0.95)[2] == math.inf


@given(seed=st.integers(0, 1000), share=st.sampled_from([0.05, 0.5, 0.95]))
def test_the_interval_of_a_quantile_holds_the_sample_quantile(seed: int, share: float) -> None:
    values, _ = _skewed(seed, 60)
    value, low, high = statistics.quantile(values, share)
    assert low <= value <= high


def test_uneven_finishes_are_told_from_even_ones() -> None:
    assert statistics.discordance(0, 0) == 1.0
    assert statistics.discordance(5, 5) == 1.0
    assert statistics.discordance(10, 0) == pytest.approx(2 / 1024)


def test_a_trend_finds_the_line_that_values_lie_on() -> None:
    xs = np.array([0.0, 1, 2, 5])
    found = statistics.trend(xs, [statistics.LogRatio(0.3 + 0.2 * x, 0.01, 100) for x in xs])
    assert found.value == pytest.approx(0.2)
    assert found.low < 0.2 < found.high
