"""Intervals of the report, each a formula of its sample alone: nothing here draws a random number.

Ratios of means are compared on common missions. Their interval is Student's, of the linearised logarithm of the ratio: of
`a / mean(a) - b / mean(b)`, mission by mission, which is how much each mission moves `log(mean(a) / mean(b))`. It is paired,
the same for the same rows, positive at both ends, and sums over scenarios by adding variances; a bootstrap offers none of the
last three. A test holds it against the bias-corrected bootstrap on skewed samples. Shares have Wilson's interval, which is
right for none and for all, too; quantiles that of the order statistics, which assumes nothing of the distribution.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lalliance_study.extras import study_package

stats = study_package("scipy.stats")

Floats = NDArray[np.float64]

#: How sure the intervals are, unless another level is asked for.
CONFIDENCE = 0.95


class Estimate(NamedTuple):
    """A value and the ends of its interval; the ends are not numbers where the sample is too small for any."""

    value: float
    low: float
    high: float

    def apart_from(self, reference: float) -> bool:
        """Whether the interval leaves a value out."""
        return self.low > reference or self.high < reference


class LogRatio(NamedTuple):
    """The logarithm of a ratio of means, with its standard error and degrees of freedom: what ratios are pooled from."""

    value: float
    error: float
    freedom: float

    def ratio(self, confidence: float = CONFIDENCE) -> Estimate:
        """The ratio itself, with its interval."""
        reach = _student(confidence, self.freedom) * self.error
        return Estimate(*(float(np.exp(self.value + step)) for step in (0.0, -reach, reach)))


def _student(confidence: float, freedom: float) -> float:
    return float(stats.t.ppf((1 + confidence) / 2, freedom)) if freedom > 0 else math.nan


def mean(values: Floats, confidence: float = CONFIDENCE) -> Estimate:
    """The mean of a sample `[missions]`, with Student's interval."""
    centre = float(values.mean())
    if len(values) < 2:
        return Estimate(centre, math.nan, math.nan)
    reach = _student(confidence, len(values) - 1) * float(values.std(ddof=1)) / math.sqrt(len(values))
    return Estimate(centre, centre - reach, centre + reach)


def log_ratio(ours: Floats, theirs: Floats) -> LogRatio:
    """The logarithm of the mean of `ours` over the mean of `theirs`, both positive: `[missions]`, in the same order."""
    value = math.log(float(ours.mean()) / float(theirs.mean()))
    if len(ours) < 2:
        return LogRatio(value, math.nan, 0)
    pulls = ours / ours.mean() - theirs / theirs.mean()
    return LogRatio(value, float(pulls.std(ddof=1)) / math.sqrt(len(pulls)), len(pulls) - 1)


def pooled(parts: Sequence[Sequence[LogRatio]]) -> LogRatio:
    """The mean of log ratios, all of one weight: the logarithm of the geometric mean of the ratios.

    Those of one part come from the same missions, and their errors are taken as wholly alike, which is the worst case; parts
    are independent. The scenarios are what was asked for and not a sample of others, so only the missions within them make the
    mean uncertain. Degrees of freedom after Welch and Satterthwaite. A scenario of one mission makes the error unknown.
    """
    ratios = [one for part in parts for one in part]
    errors = np.array([sum(one.error for one in part) for part in parts])
    freedoms = np.array([min(one.freedom for one in part) for part in parts], dtype=np.float64)
    error = math.sqrt(float((errors**2).sum())) / len(ratios)
    value = float(np.mean([one.value for one in ratios]))
    return LogRatio(value, error, _freedom(errors**2, freedoms))


def _freedom(variances: Floats, freedoms: Floats) -> float:
    """Welch's and Satterthwaite's degrees of freedom of a sum of independent values."""
    if freedoms.min() <= 0:
        return 0.0
    shares = float((variances**2 / freedoms).sum())
    return float(variances.sum()) ** 2 / shares if shares > 0 else float(freedoms.min())


def pooled_mean(samples: Sequence[Floats], confidence: float = CONFIDENCE) -> Estimate:
    """The mean over independent scenarios, all of one weight, of the means of their samples `[missions]`."""
    centre = float(np.mean([sample.mean() for sample in samples]))
    if min(len(sample) for sample in samples) < 2:
        return Estimate(centre, math.nan, math.nan)
    variances = np.array([sample.var(ddof=1) / len(sample) for sample in samples])
    freedom = _freedom(variances, np.array([len(sample) - 1.0 for sample in samples]))
    reach = _student(confidence, freedom) * math.sqrt(float(variances.sum())) / len(samples)
    return Estimate(centre, centre - reach, centre + reach)


def proportion(count: int, total: int, confidence: float = CONFIDENCE) -> Estimate:
    """A share, with Wilson's interval."""
    if total == 0:
        return Estimate(math.nan, math.nan, math.nan)
    found = stats.binomtest(count, total).proportion_ci(confidence, method="wilson")
    return Estimate(count / total, float(found.low), float(found.high))


def quantile(values: Floats, share: float, confidence: float = CONFIDENCE) -> Estimate:
    """A quantile of a sample, with the interval between two of its order statistics.

    The ends are infinite where the sample is too small to bound the quantile on that side.
    """
    ordered = np.sort(values)
    count, tail = len(ordered), (1 - confidence) / 2
    # Of `count` values, binomially many lie below the quantile.
    low = int(stats.binom.ppf(tail, count, share))
    high = int(stats.binom.ppf(1 - tail, count, share)) + 1
    below = float(ordered[low - 1]) if low >= 1 else -math.inf
    above = float(ordered[high - 1]) if high <= count else math.inf
    return Estimate(float(np.quantile(ordered, share)), below, above)


def discordance(only_ours: int, only_theirs: int) -> float:
    """McNemar's exact test: how probable so uneven a split of the missions is that only one of the two finished."""
    total = only_ours + only_theirs
    return float(stats.binomtest(only_ours, total).pvalue) if total else 1.0


def trend(xs: Floats, ys: Sequence[LogRatio]) -> Estimate:
    """The slope of a straight line of least squares through independent values with known errors, `[values]`.

    All weigh the same, as scenarios do elsewhere; the interval heeds the errors of the values alone, not how well a line fits.
    """
    centred = xs - xs.mean()
    weights = centred / float((centred**2).sum())
    slope = float(weights @ np.array([y.value for y in ys]))
    error = math.sqrt(float((weights**2) @ np.array([y.error**2 for y in ys])))
    reach = _student(CONFIDENCE, min(y.freedom for y in ys)) * error
    return Estimate(slope, slope - reach, slope + reach)
