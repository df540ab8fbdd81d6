"""Sightings that wait to be fetched: a bounded queue that says what it dropped. Pure."""

from collections import deque
from collections.abc import Callable, Iterator

from mission_control.watch.sighting import Sighting

#: Sightings that may wait to be fetched.
CAPACITY = 20_000
#: What they may hold altogether, in bytes.
HEAVIEST = 2**26


class Waiting:
    """Sightings, the oldest first. When too many wait the oldest is dropped and counted, unless it is to be kept.

    Args:
        capacity: sightings that may wait.
        is_kept: whether what was seen on a key is never dropped.

    Attributes:
        overflowed: those that were dropped.
    """

    def __init__(self, capacity: int, is_kept: Callable[[str], bool]) -> None:
        self.overflowed = 0
        self._capacity = capacity
        self._is_kept = is_kept
        self._waiting: deque[Sighting] = deque()
        # Kept, and so older than all that waits.
        self._rescued: deque[Sighting] = deque()
        self._size = 0

    def __len__(self) -> int:
        return len(self._rescued) + len(self._waiting)

    def push(self, sighting: Sighting) -> None:
        """Have a sighting wait behind all others."""
        self._size += len(sighting.payload)
        while self._waiting and (len(self._waiting) >= self._capacity or self._size > HEAVIEST):
            oldest = self._oldest()
            if self._is_kept(oldest.key):
                self._rescued.append(oldest)
            else:
                self.overflowed += 1
        self._waiting.append(sighting)

    def fetch(self) -> Sighting | None:
        """The oldest, which waits no more; None if none does."""
        if self._rescued:
            return self._rescued.popleft()
        return self._oldest() if self._waiting else None

    def all(self) -> Iterator[Sighting]:
        """Fetch all that wait."""
        while (one := self.fetch()) is not None:
            yield one

    def _oldest(self) -> Sighting:
        oldest = self._waiting.popleft()
        self._size -= len(oldest.payload)
        return oldest
