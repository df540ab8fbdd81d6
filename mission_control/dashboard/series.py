"""Values over time in bounded room: the newest as they came, the older ones at even distances. Pure."""

from bisect import bisect_right
from typing import Generic, TypeVar

T = TypeVar("T")

#: So few values are kept whatever they weigh.
FEWEST = 8


class Series(Generic[T]):
    """Values, each with the instant from which it holds.

    When there are more than `most`, or those that are bytes are more than `heaviest` of them, the older half is thinned: a
    value stays if it is some distance later than the one that stays before it. The distance grows as the series does, so that
    the whole time is covered evenly, but for the newest half.

    Args:
        most: values to keep, at least 8.
        heaviest: bytes to keep.
    """

    __slots__ = ("_distance", "_heaviest", "_instants", "_most", "_values", "_weight")

    def __init__(self, most: int, heaviest: int = 2**24) -> None:
        self._most = most
        self._heaviest = heaviest
        self._weight = 0
        self._distance = 0.0
        self._instants: list[float] = []
        self._values: list[T] = []

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        return f"<Series of {len(self)} values>"

    @property
    def last(self) -> T | None:
        """The newest value."""
        return self._values[-1] if self._values else None

    def add(self, at: float, value: T) -> None:
        """Add a value that holds from `at` on, in seconds; an instant before the last one counts as that."""
        self._instants.append(max(at, self._instants[-1]) if self._instants else at)
        self._values.append(value)
        self._weight += _weight(value)
        if len(self) > self._most or (self._weight > self._heaviest and len(self) > FEWEST):
            self._thin()
            self._weight = sum(map(_weight, self._values))

    def _thin(self) -> None:
        half = len(self) // 2
        # So few that it takes a while until the next time, whatever the instants are.
        room = half // 2
        kept = self._kept(half)
        while len(kept) > room:
            span = self._instants[half] - self._instants[0]
            self._distance = max(2 * self._distance, span / room)
            kept = self._kept(half) if span > 0 else kept[::2]
        self._instants[:half] = [self._instants[place] for place in kept]
        self._values[:half] = [self._values[place] for place in kept]

    def _kept(self, until: int) -> list[int]:
        """The places before `until` that are far enough from each other; the first always is."""
        kept = [0]
        for place in range(1, until):
            if self._instants[place] - self._instants[kept[-1]] >= self._distance:
                kept.append(place)
        return kept

    def change(self, at: float, value: T) -> bool:
        """Add a value if it differs from the newest; whether it does."""
        if self._values and self._values[-1] == value:
            return False
        self.add(at, value)
        return True

    def at(self, instant: float) -> T | None:
        """The value that holds at `instant`; None before the first."""
        place = bisect_right(self._instants, instant)
        return self._values[place - 1] if place else None

    def between(self, since: float, until: float) -> list[tuple[float, T]]:
        """The values that begin to hold after `since` and not after `until`, each with its instant."""
        first, last = bisect_right(self._instants, since), bisect_right(self._instants, until)
        return list(zip(self._instants[first:last], self._values[first:last], strict=True))


def _weight(value: object) -> int:
    return len(value) if isinstance(value, bytes) else 0
