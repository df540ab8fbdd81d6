"""What to expect of failure detection by silence, by hand.

A robot announces itself every T = 1/rho. Its teammate looks once per control period h, on a grid of its own, and takes it to
be silent at its first look that is no less than tau after the last message heard. So after a message, the teammate waits for
u = tau plus a part of h, uniform over pairs of robots, and k = floor(u/T) further messages must all be lost for a living robot
to be taken for silent. That happens once for each message that is heard and followed by k lost ones.

Everything follows from S(k), the probability that k given messages in a row are all lost. The law counts no delays that vary,
and takes T for a whole multiple of h; otherwise announcements fall on the nearest look and intervals between them alternate.
"""

import math
from dataclasses import dataclass

import numpy as np

from lalliance_agents.model.parameters import SLACK

#: Phases of the control grid over which detection is averaged.
PHASES = 64


@dataclass(frozen=True, slots=True)
class Loss:
    """How messages of a link are lost."""

    share: float
    """p, in the long run."""
    burst: float | None = None
    """L, the mean number of messages in a burst (Gilbert-Elliott: all are lost in it, none outside); None: no bursts."""

    @property
    def kind(self) -> str:
        """In one word."""
        return "independent" if self.burst is None else "bursts"

    def rule(self) -> float | dict[str, float]:
        """The loss of a mission file's link rule."""
        if self.burst is None:
            return self.share
        leave = 1 / self.burst
        return {"enter": self.share * leave / (1 - self.share), "leave": leave}

    def all_lost(self, count: int) -> float:
        """S(k): the probability that `count` given messages in a row are all lost."""
        if self.burst is None or count == 0:
            return float(self.share**count)
        return float(self.share * (1 - 1 / self.burst) ** (count - 1))


@dataclass(frozen=True, slots=True)
class Timing:
    """What the law needs to know of a pair of robots; times in seconds."""

    tau: float
    rate: float = 5.0
    """rho, messages per second."""
    control: float = 0.1
    """h, the control period."""
    delay: float = 0.001
    """How long a message is under way."""

    def counts(self) -> list[tuple[int, float]]:
        """How many messages must be lost in a row for a false suspicion, and for which share of the pairs."""
        whole = math.floor(self.tau * self.rate + SLACK)
        room = (whole + 1) / self.rate - self.tau
        share = min(room / self.control, 1.0)
        return [(whole, share)] + ([(whole + 1, 1 - share)] if share < 1 else [])


def suspicions(loss: Loss, timing: Timing) -> float:
    """How often a living robot is taken to be silent, per pair of robots and second.

    With k = floor(tau rho): rho p^k (1 - p) for independent losses, rho (p/L) (1 - 1/L)^(k - 1) for bursts.
    """
    chances = [share * (loss.all_lost(k) - loss.all_lost(k + 1)) for k, share in timing.counts()]
    return timing.rate * sum(chances)


def dispersion(loss: Loss, timing: Timing) -> float:
    """The variance of the number of suspicions in a long time, divided by its mean; tau is to be a whole number of periods.

    It would be 1 for independent events. Suspicions of one pair cannot overlap, and after a burst the next one is not near:
    with q the chance of a suspicion at one message, it is 1 - q (1 + 2k + 2c), where c = 0 for independent losses, else
    L(1 - p) - 1, from the chain's autocorrelation.
    """
    [(count, _)] = timing.counts()
    chance = loss.all_lost(count) - loss.all_lost(count + 1)
    after = 0.0 if loss.burst is None else loss.burst * (1 - loss.share) - 1
    return 1 - chance * (1 + 2 * count + 2 * after)


def _older(loss: Loss, timing: Timing, ages: "np.ndarray[tuple[int, ...], np.dtype[np.float64]]") -> float:
    """The mean probability that the last message heard was sent longer ago than each of `ages` (in seconds)."""
    counted = np.clip(ages * timing.rate, 0.0, None)
    most = math.ceil(float(counted.max())) + 1
    lost = [loss.all_lost(k) for k in range(most + 1)]
    # Between two announcements the age grows with time, which is uniform: linear between S(k) and S(k + 1).
    return float(np.interp(counted, np.arange(most + 1), lost).mean())


def detected_within(after: float, loss: Loss, timing: Timing) -> float:
    """The probability that a robot that died is taken to be silent within `after` seconds of its death.

    A teammate that took it to be silent already when it died, falsely then, counts as having noticed at once.
    """
    waits = timing.tau + timing.control * (np.arange(PHASES) + 0.5) / PHASES
    return _older(loss, timing, waits + timing.delay - after)


def detection_quantile(share: float, loss: Loss, timing: Timing) -> float:
    """The time within which a dead robot is noticed in `share` of the cases, in seconds."""
    low, high = 0.0, timing.tau + timing.control + timing.delay
    if detected_within(0.0, loss, timing) >= share:
        return 0.0
    for _ in range(20):  # to some microseconds
        middle = (low + high) / 2
        low, high = (low, middle) if detected_within(middle, loss, timing) >= share else (middle, high)
    return high


def needed_windows(loss: Loss, rate: float, tolerated: float) -> int:
    """The smallest whole number of periods k = floor(tau rho) with at most `tolerated` false suspicions per pair and hour.

    Args:
        loss: how messages are lost.
        rate: rho, messages per second.
        tolerated: false suspicions per pair of robots and hour.
    """
    count = 2
    while 3600 * rate * (loss.all_lost(count) - loss.all_lost(count + 1)) > tolerated:
        count += 1
    return count
