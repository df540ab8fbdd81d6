"""How often something comes: the rate and the gaps of the latest arrivals. Pure."""

from collections import deque
from typing import NamedTuple

import numpy as np


class Rate(NamedTuple):
    """What `Arrivals` tells of a key, in seconds."""

    rate: float
    """Messages per second."""
    shortest: float
    longest: float
    deviation: float
    """The standard deviation of the gaps."""
    window: int
    """Messages behind these numbers."""


class Arrivals:
    """The latest arrivals on one key.

    Args:
        window: how many are looked at.
    """

    def __init__(self, window: int) -> None:
        self._instants: deque[float] = deque(maxlen=window)

    def add(self, at: float) -> None:
        """A message came at `at`, in seconds."""
        self._instants.append(at)

    def rate(self) -> Rate | None:
        """How often they come; None while fewer than two have come."""
        gaps = np.diff(np.fromiter(self._instants, float))
        lasted = float(gaps.sum())
        if lasted <= 0:
            return None
        return Rate(len(gaps) / lasted, float(gaps.min()), float(gaps.max()), float(gaps.std()), len(self._instants))
